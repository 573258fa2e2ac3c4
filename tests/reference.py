"""The rigid wheel again, by adaptive quadrature and bracketing, one row at a time.

Written from the printed equations alone; shares no line with the package.
"""

from __future__ import annotations

import math
import warnings
from itertools import pairwise

import numpy as np
from scipy.integrate import IntegrationWarning, quad
from scipy.optimize import brentq


def row_of(ground, **driven):
    """A row of the reference: values of a soil, with gear, slip and load as given."""
    names = ("cohesion", "friction_angle", "shear_modulus", "kc", "kphi", "n", "a0", "a1")
    return {name: getattr(ground, name) for name in names} | driven


def travel_ratio(slip, law="displacement-sign"):
    """v / (r omega) in the shear displacement."""
    return 1.0 - slip if slip >= 0 or law == "slip-sign" else 1.0 / (1.0 + slip)


def stresses(theta, theta1, theta2, row):
    r, s = row["radius"], row["slip"]
    law = row.get("braking", "displacement-sign")
    k = row["kc"] / row["width"] + row["kphi"]
    theta_m = (row["a0"] + row["a1"] * s) * theta1
    at = theta
    if theta < theta_m:
        at = theta1 - (theta - theta2) / (theta_m - theta2) * (theta1 - theta_m)
    # cos a - cos b as a product keeps the digits that a small arc would lose
    sink = 2.0 * math.sin(0.5 * (theta1 + at)) * math.sin(0.5 * (theta1 - at))
    sigma = k * max(r * sink, 0.0) ** row["n"]
    ratio = travel_ratio(s, law)
    j = r * (theta1 - theta - ratio * (math.sin(theta1) - math.sin(theta)))
    tau = (row["cohesion"] + sigma * math.tan(row["friction_angle"])) * (
        1.0 - math.exp(-abs(j) / row["shear_modulus"])
    )
    driven = s >= 0 if law == "slip-sign" else j >= 0
    return sigma, (tau if driven else -tau)


def turning_points(theta1, theta2, s, law="displacement-sign"):
    """Angles between exit and entry at which j vanishes."""
    if s >= 0:
        return []

    def j(t):
        return theta1 - t - travel_ratio(s, law) * (np.sin(theta1) - np.sin(t))

    grid = np.linspace(theta2, theta1, 4001)[:-1]
    value = j(grid)
    return [
        brentq(j, a, b, xtol=1e-15)
        for a, b, u, v in zip(grid[:-1], grid[1:], value[:-1], value[1:], strict=True)
        if u * v < 0
    ]


def _integral(theta1, theta2, row):
    """Integral over the contact of a function of angle and stresses, accuracy about 1e-10."""
    # plain numbers: scalars of numpy are several times slower
    row = {name: v if isinstance(v, str) else float(v) for name, v in row.items()}
    theta1, theta2, r = float(theta1), float(theta2), row["radius"]
    theta_m = (row["a0"] + row["a1"] * row["slip"]) * theta1
    law = row.get("braking", "displacement-sign")
    # the shear curve bends within this angle
    layer = row["shear_modulus"] / (r * max(1.0, travel_ratio(row["slip"], law)))
    turns = turning_points(theta1, theta2, row["slip"], law)
    ends = {theta2, theta1, theta_m, *turns}
    for x in (theta1, *turns):
        for width in (0.1, 1.0, 5.0, 30.0):
            ends |= {x - width * layer, x + width * layer}
    ends = sorted(e for e in ends if theta2 <= e <= theta1)

    def integral(f):
        with warnings.catch_warnings():
            # a part that nearly vanishes cannot have eleven digits of its own
            warnings.simplefilter("ignore", IntegrationWarning)
            return sum(
                quad(f, lo, hi, epsrel=1e-11, epsabs=0.0, limit=200)[0]
                for lo, hi in pairwise(ends)
                if hi - lo > 1e-15
            )

    return lambda f: integral(lambda t: f(t, *stresses(t, theta1, theta2, row)))


def load_carried(theta1, row, theta2=0.0):
    """W at an entry angle."""
    integral = _integral(theta1, theta2, row)
    area = row["radius"] * row["width"]
    return area * integral(lambda t, sg, ta: sg * math.cos(t) + ta * math.sin(t))


def forces(theta1, row, theta2=0.0):
    """(W, DP, T) at an entry angle."""
    r, b = row["radius"], row["width"]
    integral = _integral(theta1, theta2, row)
    pull = r * b * integral(lambda t, sg, ta: ta * math.cos(t) - sg * math.sin(t))
    torque = r * r * b * integral(lambda t, sg, ta: ta)
    return load_carried(theta1, row, theta2), pull, torque


def equilibrium(row, near=None):
    """(theta1, DP, T) where the load is carried; searched around `near` where that is given."""

    def f(th):
        return load_carried(th, row) - row["load"]

    lo, hi = (1e-5, np.pi / 2) if near is None else (near * 0.98, min(near * 1.02, np.pi / 2))
    theta1 = brentq(f, lo, hi, xtol=1e-13, rtol=1e-12)
    _, pull, torque = forces(theta1, row)
    return theta1, pull, torque
