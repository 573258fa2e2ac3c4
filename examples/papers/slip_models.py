"""Slip of a wheel-leg, and the soil, from torque, vibration and sinkage: trained, fused, measured.

Run from the repository root: python examples/papers/slip_models.py
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from datagen.generate import generate
from datagen.recipe import packaged_file, read_recipe
from soilml import Estimate, Estimator, read_table
from soilml.io.atomic_files import atomic_output
from soilml.onboard.fusion_rules import inverse_variance
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.quantities import Z_90, column
from soilml.report.aligned_text import format_table
from training.dataset import read_dataset
from training.export.model_file import export_model
from training.spec import Spec, read_spec
from training.train import TrainedModel, train

OUT = Path("demo/papers/slip_models.png")
ROWS, TEST_ROWS = 5000, 2500
RECIPE = packaged_file("wheel_leg", "datagen", "recipes").read_text().partition("[[runs]]")[0]
#: What is changed in the recipe of the package, by the name of the case.
UNKNOWN: dict[str, str] = {}
KNOWN = {
    "[0.5, 0.75] # 29 to 43 degrees": "[0.615, 0.635]",
    "[0.003, 0.01]": "[0.0059, 0.0061]",
    "[300e3, 900e3] # 12 to 36 kPa at a depth of 1 cm": "[580e3, 620e3]",
    "[3500.0, 4500.0]": "[3950.0, 4050.0]",
    "[0.2, 0.3]": "[0.245, 0.255]",
}
CASES = {
    "soil known": KNOWN,
    "soil unknown": UNKNOWN,
    "known, stiff in shear": KNOWN | {"[0.0059, 0.0061]": "[0.00079, 0.00081]"},
    "unknown, leg at 0.3 rad/s": {"turning = 3.0": "turning = 0.3"},
    "unknown, line of eq. 24": {
        "[0.5, 0.75] #": "[0.5, 0.7] #",
        "900e3] #": "600e3] #",
        'law = "spring"\nstiffness = [3500.0, 4500.0]\ndrop = [0.2, 0.3]\nturning = 3.0': (
            'law = "line"'
        ),
    },
}
#: Specs of one sensor each, and what they are called in the table.
NAMES = {
    "slip_torque_lssvm": "torque alone",
    "slip_vibration_lssvm": "vibration alone",
    "slip_torque": "torque alone, linear",
    "slip_vibration": "vibration alone, linear",
}
BANDS = np.linspace(0.1, 0.99, 30)


def made(folder: Path, changes: dict[str, str], rows: int, seed: int) -> Path:
    """Data of the recipe with some of its lines changed."""
    text = RECIPE
    for old, new in changes.items():
        assert text.count(old) == 1 or old in "".join(changes.values()), old
        text = text.replace(old, new)
    (folder / "recipe.toml").write_text(text)
    path = folder / f"data{seed}.parquet"
    generate(read_recipe(folder / "recipe.toml").sized(rows, seed), path)
    return path


def smaller(name: str) -> Spec:
    """A packaged spec with fewer centres."""
    spec = read_spec(name)
    for reader in spec.regressors:
        if "centres" in reader.model.get_params():
            reader.model.set_params(centres=60)
    return spec


def halves(name: str, data: Path) -> tuple[TrainedModel, TrainedModel]:
    """The regressors of a packaged spec that read one sensor each, and the last, that reads all."""
    spec = smaller(name)
    each = learned(replace(spec, regressors=spec.regressors[:-1]), data)
    return each, learned(replace(spec, regressors=spec.regressors[-1:]), data)


def learned(spec: Spec, data: Path) -> TrainedModel:
    """A spec trained on data."""
    return train(spec, read_dataset(data, spec.features, spec.targets))


def line(name: str, relative: float, cover: float) -> tuple[str, str, str]:
    """A line of the table: RMSE over the prior's spread, and what 90 % intervals hold."""
    return name, f"{relative:.2f}", f"{cover:.0%}"


def independent(pair: list[Estimate]) -> Estimate:
    """Estimates of two files fused by eq. 26, as if their errors were independent."""
    first, second = pair
    fused = inverse_variance(np.stack([first.mean, second.mean]), np.stack([first.std, second.std]))
    ends = {"low": fused.mean - Z_90 * fused.std, "high": fused.mean + Z_90 * fused.std}
    return replace(first, mean=fused.mean, std=fused.std, **ends)


def slip_of(folder: Path, changes: dict[str, str]) -> tuple[list[tuple[str, str, str]], dict]:
    """Figures of slip in one case; true slip and estimates of two files, rows of another seed."""
    data, test = made(folder, changes, ROWS, 1), made(folder, changes, TEST_ROWS, 2)
    joined, at_once = halves("slip", data)
    lines = []
    for label, one in (("one file: best-linear", joined), ("one file: both read at once", at_once)):
        score = one.scores["estimator"]
        lines.append(line(label, score.relative[0], score.cover90[0]))
    table = read_table(test)
    table = table.rows(table.answered)
    alone = {}
    for name in NAMES:
        export_model(learned(smaller(name), data), folder / f"{name}.onnx", data)
        estimator = Estimator.load(folder / f"{name}.onnx")
        alone[name] = estimator(**{n: table[column(n)] for n in estimator.inputs})
    machines, linear = [*alone.values()][:2], [*alone.values()][2:]
    found = dict(alone)
    for name, pair in (("two files", machines), ("two linear files", linear)):
        found[f"{name}: correlated"] = fuse_estimates(pair).estimate
        found[f"{name}: eq. 26"] = independent(pair)
    for place, (name, estimate) in enumerate(found.items()):
        off = estimate.mean[:, 0] - table["slip"]
        held = (estimate.low[:, 0] <= table["slip"]) & (table["slip"] <= estimate.high[:, 0])
        relative = np.sqrt(np.mean(off**2)) / estimate.prior.std[0]
        at = place if name in NAMES else len(lines)
        lines.insert(at, line(NAMES.get(name, name), relative, held.mean()))
    return lines, {"slip": table["slip"], **found}


def soil_of(folder: Path, changes: dict[str, str]) -> dict[str, np.ndarray]:
    """RMSE over the prior's spread of friction angle and stiffness, by what was read."""
    data = made(folder, changes, ROWS, 1)
    each, at_once = halves("leg_soil", data)
    found = {
        name: each.scores[member.regressor.name]
        for name, member in zip(("torque", "vibration", "sinkage"), each.members, strict=True)
    }
    found["three: best-linear"] = each.scores["estimator"]
    found["all at once"] = at_once.scores["estimator"]
    return {k: np.concatenate([s.relative, s.cover90]) for k, s in found.items()}


def draw(found: dict, shares: dict[str, list[float]], soil: dict[str, np.ndarray]) -> None:
    """Estimates against true slip with their bands, calibration, and shares of the prior."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    axes = figure.subplots(2, 3)
    shown = {
        "torque alone": "slip_torque_lssvm",
        "vibration alone": "slip_vibration_lssvm",
        "two files fused": "two files: correlated",
    }
    slip = found["slip"]
    for k, (axis, (title, key)) in enumerate(zip(axes[0], shown.items(), strict=True)):
        estimate = found[key]
        axis.plot(slip, estimate.mean[:, 0], ".", ms=2, alpha=0.35, color=f"C{k}")
        ends = np.linspace(0.0, 0.6, 13)
        inside = [(slip >= a) & (slip < b) for a, b in pairwise(ends)]
        middle = 0.5 * (ends[1:] + ends[:-1])
        low, high = ([np.median(v[i, 0]) for i in inside] for v in (estimate.low, estimate.high))
        axis.fill_between(
            middle, low, high, color=f"C{k}", alpha=0.2, lw=0, label="90 % interval (median)"
        )
        axis.plot([0, 0.6], [0, 0.6], "k-", lw=0.8)
        axis.set(xlabel="true slip", ylabel="estimated slip", xlim=(0, 0.6), ylim=(0, 0.6))
        axis.set_title(f"slip from {title}; soil unknown", fontsize=10)
        axis.legend(fontsize=8, loc="upper left")
        held = [np.mean(np.abs(slip - estimate.mean[:, 0]) <= _half(b) * estimate.std[:, 0])
                for b in BANDS]  # fmt: skip
        axes[1][0].plot(100 * BANDS, 100 * (held - BANDS), color=f"C{k}", label=title)
    twice = found["two files: eq. 26"]
    held = [np.mean(np.abs(slip - twice.mean[:, 0]) <= _half(b) * twice.std[:, 0]) for b in BANDS]
    axes[1][0].plot(100 * BANDS, 100 * (held - BANDS), "--", color="C3", label="both by eq. 26")
    axes[1][0].axhline(0.0, color="k", lw=0.8)
    axes[1][0].set(xlabel="stated coverage, %", ylabel="coverage beyond it, % of rows")
    axes[1][0].set_ylim(-16, 8)
    axes[1][0].set_title("calibration on another seed; soil unknown", fontsize=10)
    axes[1][0].legend(fontsize=7, loc="upper left", ncols=2)
    names = list(next(iter(shares.values())))
    place = np.arange(len(shares))
    for k, name in enumerate(names):
        axes[1][1].barh(
            place + 0.25 * (k - 1), [v[name] for v in shares.values()], 0.23, label=name
        )
    axes[1][1].set_yticks(place, [key.replace(", ", ",\n") for key in shares], fontsize=8)
    axes[1][1].invert_yaxis()
    axes[1][1].set(xlabel="RMSE of slip / prior std", xlim=(0, 1.1))
    axes[1][1].axvline(1.0, color="0.4", ls="--", lw=1)
    axes[1][1].set_title("what slip is left unknown", fontsize=10)
    axes[1][1].set_ylim(len(shares) + 0.7, -0.6)
    axes[1][1].legend(fontsize=7, loc="lower left", ncols=3, columnspacing=0.8)
    place = np.arange(len(soil))
    for k, name in enumerate(("friction angle", "stiffness at 1 cm")):
        axes[1][2].barh(place + 0.2 * (2 * k - 1), [v[k] for v in soil.values()], 0.38, label=name)
    axes[1][2].set_yticks(place, [key.replace(": ", ":\n") for key in soil], fontsize=8)
    axes[1][2].invert_yaxis()
    axes[1][2].axvline(1.0, color="0.4", ls="--", lw=1)
    axes[1][2].set(xlabel="RMSE / prior std", xlim=(0, 1.1))
    axes[1][2].set_title("the soil, slip measured; one stride", fontsize=10)
    axes[1][2].set_ylim(len(soil) + 0.2, -0.6)
    axes[1][2].legend(fontsize=7, loc="lower left", ncols=2, columnspacing=0.8)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(OUT) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


def _half(share: float) -> float:
    """Half-width of a Gaussian's interval of this share, in standard deviations."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * share))


def run() -> None:
    """Train, fuse, tell, draw."""
    figures, shares, unknown = {}, {}, {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case, changes in CASES.items():
            lines, found = slip_of(folder, changes)
            figures[case] = lines
            told = {key: float(relative) for key, relative, _ in lines}
            shares[case] = {
                "torque": told["torque alone"],
                "vibration": told["vibration alone"],
                "both read at once": told["one file: both read at once"],
            }
            if case == "soil unknown":
                unknown = found
        soil = soil_of(folder, UNKNOWN)
    print("Slip: RMSE / prior std, and what the 90 % interval covers.")
    print(f"{ROWS} rows each, {TEST_ROWS} of another seed.\n")
    for some in (list(CASES)[:2], list(CASES)[2:]):
        groups = zip(*(figures[case] for case in some), strict=True)
        rows = [(group[0][0], *(cell for line in group for cell in line[1:])) for group in groups]
        head = ("", *(text for case in some for text in (case, "90 % covers")))
        print(format_table(head, rows), end="\n\n")
    print("The soil from one stride whose slip is measured (unknown soil):\n")
    rows = [
        (k, *(f"{x:.2f}" for x in v[:2]), *(f"{x:.0%}" for x in v[2:])) for k, v in soil.items()
    ]
    print(format_table(("read", "friction angle", "stiffness", "90 % covers", "90 % covers"), rows))
    draw(unknown, shares, soil)
    print(f"\npicture: {OUT}")


if __name__ == "__main__":
    run()
