"""The verdict of a gap report in words, and the conclusions that it does not support."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.gap.results import GapReport, decimal


def verdict_sentence(
    report: GapReport, naming_obstacles: Sequence[str], model_effects: Sequence[str]
) -> str:
    """The verdict in one sentence.

    Parameters
    ----------
    naming_obstacles : sequence of str
        Why these runs cannot identify a cause.
    model_effects : sequence of str
        Names of the effects that the model had before the analysis.
    """
    names = " + ".join(
        f"{e.name} (the model has it at another size)" if e.name in model_effects else e.name
        for e in report.effects
    )
    train = report.gap["train"]
    reduction = (
        f"mean squared residual {decimal(train.before)} -> {decimal(train.after)} "
        "(noise alone gives 1)"
    )
    if report.status == "no-gap":
        return (
            "Model and measurements agree within the noise: "
            f"mean squared residual {decimal(train.before, 2)}, p = {decimal(report.p_gap, 2)}."
        )
    if report.status == "not-testable":
        why = "; ".join(naming_obstacles)
        return f"There is a gap, but these runs cannot identify its cause: {why}."
    if report.status == "unknown":
        return (
            "There is a gap, and no effect of the catalogue explains it: the best candidate has "
            "residuals inconsistent with noise, needs a law far from the catalogue's, or does not "
            "predict the held-out runs."
        )
    if report.status == "class":
        sets = ", or ".join(" + ".join(names) for names in report.cause_set)
        return (
            f"The gap is explained equally well by {sets}: {reduction}. "
            "These runs cannot distinguish them."
        )
    if report.status == "form-open":
        return (
            f"The gap is explained by {names}, with a law that differs from the catalogue's: "
            f"{reduction}."
        )
    return (
        f"The gap is explained by {names}: {reduction}. No other effect of the catalogue "
        "explains it."
    )


def unsupported_conclusions(
    report: GapReport, naming_obstacles: Sequence[str], fixed: Sequence[str]
) -> list[str]:
    """Conclusions that the report does not support; `fixed` names parameters that were fixed."""
    conclusions = [f"the cause of the gap: {obstacle}" for obstacle in naming_obstacles]
    if report.status == "no-gap":
        conclusions.append("that the model is complete: these runs merely show no disagreement")
        return conclusions
    if report.status in ("named", "form-open"):
        conclusions.append(
            "that no cause outside the catalogue has the same signature as the named effect"
        )
    if report.status == "form-open":
        conclusions.append(
            "the law of the effect: by_slip and by_load describe these data empirically"
        )
    if report.status == "class":
        conclusions.append(
            "which of the effects is present; model.toml contains the one that fits best"
        )
    if report.status == "unknown":
        conclusions.append("any cause: model.toml contains the refitted soil and no new effect")
    if fixed:
        conclusions.append(
            f"that {', '.join(fixed)} in the model file are correct: they were fixed, and an error "
            "in them appears as an effect; free them with a prior or with --free"
        )
    conclusions.append("that a smaller gap proves a cause: wrong effects reduce the gap too")
    if "held_out_region" in report.gap:
        region = report.gap["held_out_region"]
        if region.after > 0.5 * region.before and region.before > 1.5:
            conclusions.append(f"extrapolation: on {region.description} the gap is hardly reduced")
    conclusions += [f"{name}: {report.untestable[name]}" for name in sorted(report.untestable)]
    return conclusions
