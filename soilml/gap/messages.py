"""What a gap report says in words."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.gap.results import GapReport


def figure(value: float) -> str:
    """Three digits, without powers of ten."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def sentence(report: GapReport, unnameable: Sequence[str], own: Sequence[str]) -> str:
    """The verdict in one sentence; `own` are the effects that the model had before."""
    names = " + ".join(
        f"{e.name} (the model has it at another size)" if e.name in own else e.name
        for e in report.effects
    )
    train = report.gap["train"]
    closed = (
        f"mean squared residual {figure(train.before)} -> {figure(train.after)} (1 is the noise)"
    )
    if report.status == "no-gap":
        return (
            "Model and measurements agree within their noise: "
            f"mean squared residual {train.before:.2g}, p = {report.p_gap:.2g}."
        )
    if report.status == "not-testable":
        why = "; ".join(unnameable)
        return f"There is a gap, but these runs cannot name its cause: {why}."
    if report.status == "unknown":
        return (
            "There is a gap, and nothing in the catalogue explains it: the best candidate leaves "
            "more than noise, needs a law far from any known, or fails on runs it has not seen."
        )
    if report.status == "class":
        sets = ", or ".join(" + ".join(names) for names in report.cause_set)
        return f"The gap is explained equally well by {sets}: {closed}. These runs cannot choose."
    if report.status == "form-open":
        return f"The gap is {names}, by another law than the catalogue's: {closed}."
    return f"The gap is {names}: {closed}; no other effect of the catalogue explains it."


def not_claimed(report: GapReport, unnameable: Sequence[str], held: Sequence[str]) -> list[str]:
    """What a reader might take from the report, and should not; `held` were held fixed."""
    said = [f"{reason}: no cause is named" for reason in unnameable]
    if report.status == "no-gap":
        said.append("that the model is complete: only that these runs do not show otherwise")
        return said
    if report.status in ("named", "form-open"):
        said.append("a cause outside the catalogue that acts just like the one named")
    if report.status == "form-open":
        said.append("the law of the effect: by_slip and by_load only follow the data")
    if report.status == "class":
        said.append("which of the effects it is; model.toml carries the best one as a stand-in")
    if report.status == "unknown":
        said.append("any cause: model.toml is the soil fitted again and nothing else")
    if held:
        said.append(
            f"that {', '.join(held)} of the model file are right: they were held, and what is off "
            "in them looks like an effect; let them differ with a prior, or with --free"
        )
    said.append("that a smaller gap proves a cause: wrong effects close gaps too")
    if "held_out_region" in report.gap:
        region = report.gap["held_out_region"]
        if region.after > 0.5 * region.before and region.before > 1.5:
            said.append(f"extrapolation: on {region.what} the gap hardly shrinks")
    for name in sorted(report.untestable):
        said.append(f"anything about {name}: {report.untestable[name]}")
    return said
