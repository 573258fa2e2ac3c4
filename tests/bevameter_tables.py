"""Plate-sinkage and shear tests that obey known laws."""

import numpy as np

from soilml.io.table import Table

KC, KPHI, N = 5e3, 600e3, 0.9
C, PHI, K = 800.0, 0.6, 0.012


def plates(sizes=(0.05, 0.10), repeats=3, scatter=(0.0, 0.0), seed=0, points=12, **law):
    """Tests that obey Bekker's law, each with its own relative pressure and exponent."""
    rng = np.random.default_rng(seed)
    kc, kphi, n = (law.get(key, value) for key, value in (("kc", KC), ("kphi", KPHI), ("n", N)))
    z = np.linspace(0.005, 0.08, points)
    parts = []
    for size in sizes:
        for i in range(repeats):
            level, change = np.asarray(scatter) * rng.standard_normal(2)
            p = (kc / size + kphi) * 0.06**n * np.exp(level) * (z / 0.06) ** (n + change)
            parts.append((np.full(points, f"{size:g}_{i}"), np.full(points, size), z, p))
    test, size, sinkage, pressure = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Table(
        {"test": test, "plate_radius_m": size, "sinkage_m": sinkage, "pressure_Pa": pressure}
    )


def shear(stresses=(5e3, 10e3, 20e3), repeats=2, scatter=0.0, seed=0, points=15):
    """Tests that obey Mohr and Coulomb, and Janosi and Hanamoto."""
    rng = np.random.default_rng(seed)
    j = np.linspace(0.002, 0.08, points)
    parts = []
    for sigma in stresses:
        for i in range(repeats):
            factor = np.exp(scatter * rng.standard_normal())
            tau = (C + sigma * np.tan(PHI)) * factor * -np.expm1(-j / K)
            parts.append((np.full(points, f"{sigma:g}_{i}"), np.full(points, sigma), j, tau))
    test, sigma, displacement, stress = (np.concatenate(part) for part in zip(*parts, strict=True))
    columns = {"test": test, "normal_stress_Pa": sigma}
    return Table(columns | {"shear_displacement_m": displacement, "shear_stress_Pa": stress})
