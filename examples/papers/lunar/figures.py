"""The two figures of the lunar sweep."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lunar.pull import mean_and_interval
from lunar.sweep import Floats

from soilml import Estimate
from soilml.io.atomic_files import atomic_output
from soilml.quantities import Z_90

#: Factor from SI and unit by parameter, in order.
SHOWN = ((1e-3, "kPa"), (57.29578, "deg"), (1e3, "mm"))
LABELS = ("cohesion c, kPa", "friction angle φ, deg", "shear modulus K, mm")
ONE, ALL, LEAST, EXACT = "#2b6cb0", "#c53030", "#2f855a", "#6b46c1"
GREY, TRUTH = "0.92", "k"


@dataclass(frozen=True)
class Sweep:
    """A sweep: slips (m,), estimates of each reading and of all, and pulls from each."""

    slip: Floats
    single: Estimate
    joint: Estimate
    least: tuple[Floats, Floats]  # value and std, (p,)
    exact: Floats  # draws of the exact posterior, (n, p)
    truth: Floats  # (3,)
    prior: tuple[Floats, Floats]  # ends, (3,)
    pull: Floats  # N, true, (m,)
    pulls: dict[str, tuple[Floats, Floats, Floats]]  # mean, and 90 % interval


@dataclass(frozen=True)
class PosteriorPanel:
    """Posterior of some readings: exact samples (n, 3), and the Gaussian of the LS-SVM."""

    title: str
    draws: Floats
    mean: Floats
    covariance: Floats


def draw_sweep(sweep: Sweep, out: Path) -> None:
    """Three parameters and the drawbar pull along the sweep."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 7.6), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    for k, axis in enumerate(axes[:3]):
        _parameter(axis, sweep, k)
    _pulls(axes[3], sweep)
    for axis in axes:
        axis.set_xlabel("slip")
        axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False)
    figure.suptitle(
        "A sweep of slip at 50 N: information in each reading of slip, torque and load (90 %)"
    )
    with atomic_output(out) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _parameter(axis: Any, sweep: Sweep, k: int) -> None:
    factor = SHOWN[k][0]
    low, high = (end[k] * factor for end in sweep.prior)
    axis.axhspan(low, high, color=GREY, lw=0, label="prior")
    one = sweep.single
    band = {"color": ONE, "alpha": 0.25, "lw": 0}
    axis.fill_between(sweep.slip, one.low[:, k] * factor, one.high[:, k] * factor, **band)
    axis.plot(sweep.slip, one.mean[:, k] * factor, color=ONE, lw=1.8, label="one, LS-SVM")
    axis.axhline(sweep.truth[k] * factor, color=TRUTH, lw=1.4, ls="--", label="truth")
    joint, (value, std) = sweep.joint, sweep.least
    ends = [[(joint.mean - joint.low)[k]], [(joint.high - joint.mean)[k]]]
    bar = {"ms": 7, "lw": 2.2, "capsize": 3, "zorder": 5}
    axis.errorbar(
        [0.62], [joint.mean[k] * factor], np.asarray(ends) * factor,
        fmt="D", color=ALL, label="all, set posterior", **bar,
    )  # fmt: skip
    reach = Z_90 * std[k]
    inside = np.clip([value[k] - reach, value[k] + reach], *(end[k] for end in sweep.prior))
    ends = [[value[k] - inside[0]], [inside[1] - value[k]]]
    axis.errorbar(
        [0.642], [value[k] * factor], np.asarray(ends) * factor,
        fmt="s", color=LEAST, label="all, least squares", **bar,
    )  # fmt: skip
    value, *ends = mean_and_interval(sweep.exact[:, k])
    axis.errorbar(
        [0.664], [value * factor], np.abs(np.asarray(ends) - value)[:, None] * factor,
        fmt="o", color=EXACT, label="all, exact posterior", **bar,
    )  # fmt: skip
    margin = 0.04 * (high - low)
    axis.set(xlim=(0.19, 0.68), ylim=(low - margin, high + margin), title=LABELS[k])
    axis.set_xticks([0.2, 0.3, 0.4, 0.5, 0.6, 0.642], ["0.2", "0.3", "0.4", "0.5", "0.6", "all"])


def _pulls(axis: Any, sweep: Sweep) -> None:
    prior, low, high = sweep.pulls["prior"]
    axis.fill_between(sweep.slip, low, high, color=GREY, lw=0)
    mean, low, high = sweep.pulls["one"]
    axis.fill_between(sweep.slip, low, high, color=ONE, alpha=0.25, lw=0)
    axis.plot(sweep.slip, mean, color=ONE, lw=1.2)
    _, low, high = sweep.pulls["all"]
    for edge in (low, high):
        axis.plot(sweep.slip, edge, color=ALL, lw=1.4)
    for name, color in (("least", LEAST), ("exact", EXACT)):
        _, low, high = sweep.pulls[name]
        axis.fill_between(sweep.slip, low, high, color=color, lw=0, alpha=0.6)
    axis.plot(sweep.slip, sweep.pull, color=TRUTH, lw=1.4, ls="--")
    axis.plot(sweep.slip, prior, color="0.3", lw=1.2, ls=":")
    for said, height, color in (
        ("prior's mean", prior[-1], "0.3"),
        ("set posterior,\nboth ends", sweep.pulls["all"][2][-1], ALL),
    ):
        axis.annotate(said, (sweep.slip[-1], height), (6, 0), color=color, va="center",
                      textcoords="offset points", fontsize=9)  # fmt: skip
    axis.set_title("drawbar pull predicted from these, N (bands: 90 %)")
    axis.set_xlim(0.19, 0.68)


def draw_posteriors(
    told: list[PosteriorPanel], truth: Floats, prior: tuple[Floats, Floats], out: Path
) -> None:
    """Pairs of parameters, row by row, for more readings from left to right."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(11.5, 11.2), layout="constrained")
    scale = np.asarray([factor for factor, _ in SHOWN])
    low, high = (end * scale for end in prior)
    grid = figure.subplots(3, len(told), squeeze=False)
    for row, (i, j, other) in enumerate(((0, 1, 2), (0, 2, 1), (1, 2, 0))):
        for axis, one in zip(grid[row], told, strict=True):
            draws = one.draws * scale
            dots = axis.scatter(
                draws[:, i], draws[:, j], c=draws[:, other], s=5, lw=0, alpha=0.7,
                cmap="viridis", vmin=low[other], vmax=high[other], rasterized=True,
            )  # fmt: skip
            _ellipse(axis, one.mean * scale, one.covariance * np.outer(scale, scale), i, j)
            axis.plot(
                truth[i] * scale[i], truth[j] * scale[j], "*", ms=15, mfc="white", mec="k", mew=1.4
            )
            axis.set(xlim=(low[i], high[i]), ylim=(low[j], high[j]), xlabel=LABELS[i])
            axis.set_facecolor("0.97")
        grid[row, 0].set_ylabel(LABELS[j])
        bar = figure.colorbar(dots, ax=grid[row, -1], pad=0.02, aspect=28)
        bar.set_label(LABELS[other])
        bar.solids.set_alpha(1.0)
    for axis, one in zip(grid[0], told, strict=True):
        axis.set_title(one.title, fontsize=12)
    handles = [
        Line2D([], [], marker="o", ls="", color="#2a788e", label="soils that explain the readings"),
        Line2D([], [], color=ALL, lw=2, label="LS-SVM: its Gaussian, 90 %"),
        Line2D([], [], marker="*", ls="", ms=14, mfc="white", mec="k", label="truth"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=11)
    figure.suptitle(
        "Slip, torque and load on lunar soil of known bearing; the frame is the prior",
        fontsize=13,
    )
    with atomic_output(out) as part:
        figure.savefig(part, format="png", dpi=90, metadata={"Software": "soilml"})


def _ellipse(axis: Any, mean: Floats, covariance: Floats, i: int, j: int) -> None:
    """The 90 % ellipse of a Gaussian of two parameters."""
    pair = [i, j]
    variance, vectors = np.linalg.eigh(covariance[np.ix_(pair, pair)])
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = np.sqrt(2.0 * np.log(10.0)) * np.stack([np.cos(angle), np.sin(angle)])
    x, y = mean[pair][:, None] + vectors @ (np.sqrt(variance)[:, None] * circle)
    axis.plot(x, y, color="white", lw=4)
    axis.plot(x, y, color=ALL, lw=2)
