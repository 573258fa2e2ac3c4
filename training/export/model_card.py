"""The card beside a model file: what it is, what it was trained on, how good it is."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from training.calibration.scores import Score
from training.set_posterior.metadata import table_of
from training.train import Trained

WORTH = (
    "One reading brings one equation for all these unknowns: the estimate is mostly the prior, "
    "and its standard deviation says so. Use several readings of one soil together "
    "(`soilml estimate --by run`, `Estimator.run`)."
)
PER_ROW_WORTH = (
    "Slip differs from row to row: each reading is estimated by itself. How much of the answer is "
    "the prior depends on how well the soil is known, and the standard deviation says it."
)
TOGETHER = (
    "Several readings of one soil together (`run`), by what the run varied: what came of them "
    "on runs that joining was not fitted to. Rows of nearly the same slip and load count as "
    "one, and a run between these kinds is taken between them."
)

POSTERIOR = (
    "Several readings of one soil together by the set posterior (`run`, `step`): the exact "
    "likelihood of all readings under a learned response of the wheel, sampled in the graph. On "
    "fresh sets, driven anywhere, at three levels or steadily; in a third sinkage and drawbar pull "
    "are measured too. Sets that are refused count with the prior."
)


def card(trained: Trained, metadata: Mapping[str, str], name: str) -> str:
    """The card as Markdown."""
    outputs = json.loads(metadata["outputs"])
    inputs = json.loads(metadata["inputs"])
    recipe = json.loads(metadata["recipe"])
    gear = ", ".join(f"{k} {v}" for k, v in json.loads(metadata["gear"]).items())
    kinds = ", ".join(_described(m.regressor.machine, m.regressor.kind) for m in trained.members)
    parts = trained.parts
    fused = len(trained.members) > 1
    lines = [
        f"# {name}",
        "",
        f"Estimates {_list(o['name'].replace('_', ' ') for o in outputs)} from one reading of "
        f"{_list(i['name'] for i in inputs)}. Regressors: {kinds}."
        + (f" Joined by the rule `{trained.spec.rule}`." if fused else ""),
        "",
        PER_ROW_WORTH if trained.spec.per_row else WORTH,
        "",
        "## Valid for",
        "",
        f"- gear: {gear or 'not recorded'}",
        f"- soil outside the estimated parameters: {_soil(recipe, trained.spec.targets)}",
        *[f"- effect: {json.dumps(e)}" for e in recipe.get("effect", [])],
        f"- noise: {json.dumps(recipe.get('noise', {}))}; bias per run: "
        f"{json.dumps(recipe.get('bias', {}))}",
        "",
        "| input | column | unit | trained from | to |",
        "|---|---|---|---:|---:|",
        *[
            f"| {i['name']} | `{i['column']}` | {i['unit']} | {i['lower']:.4g} | {i['upper']:.4g} |"
            for i in inputs
        ],
        "",
        "Readings outside, or unlike any that were trained on, come back with `in_range` false.",
        "",
        "| output | column | unit | prior from | to | prior std |",
        "|---|---|---|---:|---:|---:|",
        *[
            f"| {o['name']} | `{o['column']}` | {o['unit']} | {o['lower']:.4g} | {o['upper']:.4g} "
            f"| {o['prior_std']:.4g} |"
            for o in outputs
        ],
        "",
        "## Figures",
        "",
        f"On {trained.scores['estimator'].rows} rows that nobody learned from or calibrated on. "
        "Error is RMSE / prior std; likelihood is the mean negative log density of the value over "
        "the prior std (prior alone: 1.42 as a Gaussian); coverage is of the 90 % interval.",
        "",
        *_scores(trained.scores, [o["name"] for o in outputs]),
        "",
        *(
            []
            if trained.spec.per_row or trained.posterior
            else _together(trained, [o["name"] for o in outputs])
        ),
        *_posterior(trained, [o["name"] for o in outputs]),
        "## Made by",
        "",
        f"- rows: {len(parts.train)} learned from, {len(parts.choose)} to stop and choose by, "
        f"{len(parts.calibrate)} to calibrate and score; {trained.data.dropped} dropped",
        f"- training recipe sha256 `{metadata['recipe_sha256']}`",
        f"- data sha256 `{metadata['data_sha256']}`",
        f"- spec: `{metadata['spec']}`",
        f"- float32 file against float64 original: at most {metadata['parity']} of the prior's "
        f"spread; opset {metadata['opset']}, IR {metadata['ir_version']}",
        f"- soilml {metadata['soilml_version']}",
        "",
    ]
    return "\n".join(lines)


def _described(regressor: Any, kind: str) -> str:
    details = ""
    if hasattr(regressor, "centres_"):
        details = (
            f" ({len(regressor.centres_)} centres, gamma {regressor.gamma_:.3g}, "
            f"width {regressor.width_:.3g})"
        )
    if hasattr(regressor, "history_"):
        layers = " x ".join(str(h) for h in regressor.hidden)
        details = f" (hidden {layers}, {len(regressor.history_)} epochs)"
    return f"{kind}{details}"


def _list(words: Any) -> str:
    words = list(words)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _soil(recipe: Mapping[str, Any], targets: Sequence[str]) -> str:
    soil = dict(recipe.get("soil", {}))
    prior = soil.pop("prior", {})
    unknown = {k: v for k, v in prior.items() if k not in targets}
    text = json.dumps(soil) if soil else "not recorded"
    return f"{text}; varied and not estimated: {json.dumps(unknown)}" if unknown else text


def _scores(scores: Mapping[str, Score], names: list[str]) -> list[str]:
    head = " | ".join(f"error {n}" for n in names)
    logs = " | ".join(f"-log p {n}" for n in names)
    cover = " | ".join(f"90 % {n}" for n in names)
    lines = [f"| | {head} | {logs} | {cover} |", "|---|" + "---:|" * (3 * len(names))]
    for name, s in scores.items():
        cells = [f"{v:.3f}" for v in (*s.relative, *s.nll)] + [f"{v:.1%}" for v in s.cover90]
        label = f"**{name}**" if name == "estimator" else name
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return lines


def _posterior(trained: Trained, names: list[str]) -> list[str]:
    """What the set posterior gives, on fresh simulated sets."""
    if trained.posterior is None:
        return []
    return [POSTERIOR, "", *table_of(trained.figures, names)]


def _together(trained: Trained, names: list[str]) -> list[str]:
    head = " | ".join(f"{what} {n}" for what in ("error", "90 %") for n in names)
    lines = [TOGETHER, "", f"| run | rows | sets | {head} |"]
    lines.append("|---|---:|---:|" + "---:|" * (2 * len(names)))
    for kind, scores in trained.sets.items():
        for rows, score in scores.items():
            cells = [f"{v:.3f}" for v in score.relative] + [f"{v:.1%}" for v in score.cover90]
            lines.append(f"| {kind} | {rows} | {score.rows} | {' | '.join(cells)} |")
        if not scores:
            lines.append(f"| {kind} | | 0 |{' |' * (2 * len(names))}")
    return [*lines, ""]
