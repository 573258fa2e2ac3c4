"""The card beside a model file: validity, metrics and provenance."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from soilml.quantities import SHEAR
from training.calibration.recalibration import Metrics
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.validation import SetFigures, table_of
from training.train import TrainedModel

SINGLE_READING = (
    "A single reading is one equation for all these unknowns: the estimate is mostly the prior, "
    "and its standard deviation is not much smaller than the prior's. Use several readings of one "
    "soil together (`soilml estimate --by run`, `Estimator.run`)."
)
PER_ROW = (
    "Slip differs between rows: each reading is estimated by itself. How much the estimate depends "
    "on the prior depends on how well the soil is known; the standard deviation shows it."
)
MEASURED = (
    "On {rows} rows, each estimated by a fit that has not seen its run. Error is RMSE / prior std; "
    "-log p is the mean negative log density of the value over the prior std (prior alone: 1.42 as "
    "a Gaussian); 90 % is the coverage of the Gaussian 90 % interval. The sizes of standard "
    "deviations and intervals are calibrated on these same errors."
)
FEW_RUNS = (
    "A campaign of few rows: the {runs} runs do not tell how the standard deviation varies, and it "
    "is constant. Rows of one run share a part of their error; together they are worth "
    "{freedom:.0f} independent ones."
)
ONE_RUN = (
    "All rows are of one run: the intervals are valid for readings of this run's soil, and nothing "
    "is known of others."
)
HELD_OUT = (
    "The file has its errors on {rows} rows left out: fused with another file that was trained "
    "from the same data, it is weighed by the correlation of their errors, and the interval is "
    "calibrated for the pair. Repeated readings of one soil at one slip and load share most "
    "of their error, which does not average out."
)
SET_POSTERIOR = (
    "Several readings of one soil by the set posterior (`run`, `step`): the exact likelihood of "
    "all readings under a learned response of the wheel, sampled in the graph. On fresh simulated "
    "sets with free, three-level or steady operating conditions; a third of them with sinkage and "
    "drawbar pull. Refused sets count with the prior. The model is taken as right there "
    "(`model_error` 0), as it is in the simulation; the file's own answer has errors of the model."
)

#: What a card says of a file for a microcontroller.
SMALL = (
    "For a microcontroller: the response has fewer monomials and a smaller network, and fewer "
    "points are sampled."
)
#: How the prior is weighted where its soils do not carry all loads.
CARRIED = (
    "Soils of the prior carry the wheel in {:.2%} of the operating conditions. The others take no "
    "part in the training, and these sets are of soils that carry all their rows: a soil counts by "
    "the loads that it carries."
)


def model_card(trained: TrainedModel, metadata: Mapping[str, str], name: str) -> str:
    """The card of a model file as Markdown, from its model, metadata and name."""
    targets = [output["name"] for output in json.loads(metadata["outputs"])]
    lines = [
        f"# {name}",
        "",
        *_summary(trained, metadata),
        "## Valid for",
        "",
        *_validity(trained, metadata),
        "## Figures",
        "",
        *_judged_on(trained),
        "",
        *_metrics_table(trained.scores, targets),
        "",
    ]
    if trained.set_posterior is not None:
        lines += [SET_POSTERIOR, "", *table_of(trained.set_figures, targets)]
        if (carried := trained.set_posterior.response.carried) < 1.0:
            lines += [CARRIED.format(carried), ""]
        lines += [*trained.set_posterior.scales.for_card(), ""]
    elif trained.errors is not None:
        lines += [HELD_OUT.format(rows=len(trained.errors.rows)), ""]
    lines += ["## Made by", "", *_provenance(trained, metadata), ""]
    return "\n".join(lines)


def _judged_on(trained: TrainedModel) -> list[str]:
    """What the figures were measured on."""
    left = trained.left_out
    text = MEASURED.format(rows=trained.scores["estimator"].rows)
    if left.few:
        text += " " + FEW_RUNS.format(runs=left.runs, freedom=left.freedom.min() + 1.0)
    return [text] if left.runs > 1 else [text, "", ONE_RUN]


def _summary(trained: TrainedModel, metadata: Mapping[str, str]) -> list[str]:
    """What is estimated from what, and by which regressors."""
    outputs = _enumerate(o["name"].replace("_", " ") for o in json.loads(metadata["outputs"]))
    inputs = _enumerate(i["name"] for i in json.loads(metadata["inputs"]))
    used = [member.regressor for member in trained.members]
    settings = [one.model.fitted_settings() for one in used]
    regressors = ", ".join(
        f"{one.name} ({own})" if own else one.name for one, own in zip(used, settings, strict=True)
    )
    text = f"Estimates {outputs} from one reading of {inputs}. Regressors: {regressors}."
    if len(trained.members) > 1:
        text += " They are fused by the covariance of their errors."
    return [text, "", PER_ROW if trained.spec.per_row else SINGLE_READING, ""]


def _validity(trained: TrainedModel, metadata: Mapping[str, str]) -> list[str]:
    """Gear, soil, effects and noise of the training data; ranges of inputs and outputs."""
    recipe = json.loads(metadata["recipe"])
    gear = ", ".join(f"{k} {v}" for k, v in json.loads(metadata["gear"]).items())
    noise, bias = (json.dumps(recipe.get(key, {})) for key in ("noise", "bias"))
    return [
        f"- gear: {gear or 'not recorded'}",
        f"- soil outside the estimated parameters: {_soil(recipe, trained.spec.targets)}",
        *[f"- effect: {json.dumps(effect)}" for effect in recipe.get("effect", [])],
        f"- noise: {noise}; bias per run: {bias}",
        "",
        "| input | column | unit | trained from | to |",
        "|---|---|---|---:|---:|",
        *[
            f"| {i['name']} | `{i['column']}` | {i['unit']} | {i['lower']:.4g} | {i['upper']:.4g} |"
            for i in json.loads(metadata["inputs"])
        ],
        "",
        "Readings outside these ranges, or far from all training rows, have `in_range` false.",
        "",
        "| output | column | unit | prior from | to | prior std |",
        "|---|---|---|---:|---:|---:|",
        *[
            f"| {o['name']} | `{o['column']}` | {o['unit']} | {o['lower']:.4g} | {o['upper']:.4g} "
            f"| {o['prior_std']:.4g} |"
            for o in json.loads(metadata["outputs"])
        ],
        "",
    ]


def _provenance(trained: TrainedModel, metadata: Mapping[str, str]) -> list[str]:
    rows = f"{len(trained.data)}, all for training; {trained.data.dropped} dropped"
    return [
        f"- rows: {rows}",
        f"- training recipe sha256 `{metadata['recipe_sha256']}`",
        f"- data sha256 `{metadata['data_sha256']}`",
        f"- spec: `{metadata['spec']}`",
        f"- float32 file against float64 original: at most {metadata['parity']} of the prior's "
        f"spread; opset {metadata['opset']}, IR {metadata['ir_version']}",
        f"- soilml {metadata['soilml_version']}",
    ]


def _enumerate(words: Iterable[str]) -> str:
    words = list(words)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _soil(recipe: Mapping[str, Any], targets: Sequence[str]) -> str:
    soil = dict(recipe.get("soil", {}))
    prior = soil.pop("prior", {})
    unknown = {k: v for k, v in prior.items() if k not in targets}
    text = json.dumps(soil) if soil else "not recorded"
    return f"{text}; varied and not estimated: {json.dumps(unknown)}" if unknown else text


def _metrics_table(scores: Mapping[str, Metrics], targets: list[str]) -> list[str]:
    """Error, likelihood and coverage of every target, a line for each estimate."""
    heads = [f"{what} {target}" for what in ("error", "-log p", "90 %") for target in targets]
    lines = [f"| | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    for name, metrics in scores.items():
        values = [f"{v:.3f}" for v in (*metrics.relative, *metrics.nll)]
        values += [f"{v:.1%}" for v in metrics.cover90]
        label = f"**{name}**" if name == "estimator" else name
        lines.append(f"| {label} | {' | '.join(values)} |")
    return lines


def any_wheel_card(
    metadata: Mapping[str, str],
    units: Mapping[str, str],
    figures: Mapping[int, SetFigures],
    name: str,
) -> str:
    """The card of a file for any wheel, from metadata, units of its own inputs, and set metrics."""
    sets = json.loads(metadata["set"])
    error, pressure, sinkage = sets["error"], sets["ground_pressure"], sets["sinkage_over_radius"]
    noise = {
        name: f"{100 * share:g} % + {constant:g}"
        for name, (constant, share) in sets["noise"].items()
    }
    lines = [
        f"# {name}",
        "",
        "Estimates cohesion, friction angle and shear modulus from one or many readings of slip, "
        "torque and load, and of sinkage and drawbar pull where they are measured, for a rigid "
        "wheel of any size: wheel, bearing values, noise and upper bounds of the prior are inputs.",
        "",
        f"    estimator = Estimator.load('{name}.onnx').on(wheel_radius=0.15, ...)",
        "    estimator.run(slip=..., torque=..., load=...)",
        "",
        "The exact likelihood of all readings under a learned response of the wheel is sampled in "
        "the graph; the posterior itself is not learned. Uncertain bearing values are integrated "
        "out as errors that all rows share. Bearing values: the pressure is "
        "bearing_modulus z^n, with bearing_modulus = kc / b + kphi; bearing_std is the standard "
        "deviation of its logarithm at a sinkage of r / 20, and four times that of n. theta_m / "
        "theta_1 is 0.4 + 0.15 s. The prior is uniform: cohesion from 0 to cohesion_max, friction "
        "angle from 25 to 45 degrees, shear modulus from shear_modulus_max / 6 to "
        "shear_modulus_max.",
        "",
        *([SMALL, ""] if sets.get("small") else []),
        "## Valid for",
        "",
        "| input | unit | from | to |",
        "|---|---|---:|---:|",
        *[
            f"| `{name}` | {units[name]} | {low:.4g} | {high:.4g} |"
            for name, (low, high) in sets["context"].items()
        ],
        "",
        f"Slip {_range(sets['slip'])}; load {_range(sets['load'])} N; load / (radius width) "
        f"{_range(pressure)} Pa; sinkage / radius {_range(sinkage)} on soil in the middle of the "
        "prior. Rows outside these ranges have `in_range` false.",
        "",
        f"Default noise: {json.dumps(noise)}.",
        "",
        "## Figures",
        "",
        f"Error of the learned response, rms: torque {error['torque']:.2%}, sinkage "
        f"{error['sinkage']:.2%}, drawbar pull {error['drawbar_pull']:.2%} of the load.",
        "",
        "On fresh simulated sets: wheels, loads, soils and bearing values over their whole ranges, "
        "torque noise from 1 to 8 %; a third of the sets with a bias of the torque sensor, a third "
        "with a known bearing curve, a third with sinkage and drawbar pull. Error is RMSE / prior "
        "std; 90 % is the coverage of the 90 % interval; refused sets count with the prior. The "
        "model is taken as right there (`model_error` 0), as it is in the simulation; the file's "
        "own answer has errors of the model.",
        "",
        *table_of(figures, list(SHEAR)),
        *ErrorScales.of_list(sets["model_error_scales"]).for_card(),
        "",
        "## Made by",
        "",
        f"- spec sha256 `{metadata['spec_sha256']}`",
        f"- spec: `{metadata['spec']}`",
        f"- opset {metadata['opset']}, IR {metadata['ir_version']}; soilml "
        f"{metadata['soilml_version']}",
        "",
    ]
    return "\n".join(lines)


def _range(setting: Any) -> str:
    low, high = setting["range"] if isinstance(setting, dict) else setting
    return f"{low:g} to {high:g}"
