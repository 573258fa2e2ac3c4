"""Reasons in a few words, with the explanation that each is about."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.quantities import COLUMNS
from soilml.remarks import Remark
from soilml.report.numbers import channel_name

REASON_WORDS = 12  # Words of a reason without a name that stands in a headline or line, at most
SENTENCE_WORDS = 30  # Words of a sentence, at most

#: Reasons in a few words, by their codes; the report lists them in full.
_IN_SHORT = {
    "noise-scaled": "readings scatter more than their noise",
    "runs-differ": "runs differ like different soils",
    "repeats-disagree": "repeats differ by more than their noise",
    "region-not-predicted": "one region is not predicted by the other rows",
    "soil-test": "rows and tests of the soil disagree",
    "excess-residuals": "residuals exceed the declared noise",
    "soil-at-prior": "the soil is at ends of its priors",
    "nothing-is-better": "no effect or smooth discrepancy is better",
    "not-decisive": "the evidence is not decisive",
    "soil-outside-priors": "a soil outside its priors explains the rows",
    "prior-opened": "the priors of the soil were opened",
    "few-readings": "there are few readings",
    "one-run": "there is one run only",
    "one-load": "there is one load only",
    "few-slips": "there are too few slips",
}
#: Those about an explanation, whose effects take the place of the braces.
_OF_EXPLANATION = {
    "implausible-fault": "{} would be an implausibly large fault",
    "unchecked-fault": "{} is a fault that nothing has checked",
    "implausible-size": "{} would have to be implausibly large",
    "not-predictive": "beside a smooth remainder, {} predicts rows kept back no better than the "
    "soil alone",
    "other-law": "the law of {} differs from the catalogue's",
    "not-catalogued": "a large discrepancy{channel} is left beside {}",
}


def short_reason(reason: Remark) -> str:
    """A reason in a few words, with the effects of the explanation that it is about."""
    if pattern := _OF_EXPLANATION.get(reason.code):
        names = " + ".join(n for n in reason.about if n not in COLUMNS) or "the best fit"
        channels = [channel_name(n) for n in reason.about if n in COLUMNS]
        return pattern.format(names, channel="".join(f" of {name}" for name in channels))
    text = _IN_SHORT.get(reason.code, reason.text)
    return text if len(text.split()) <= REASON_WORDS else "see the reasons"


def in_sentences(begin: str, parts: Sequence[str]) -> str:
    """Parts after `begin`, in sentences of at most `SENTENCE_WORDS` words where each has fewer.

    >>> in_sentences("Why", ["a b", "c d"])
    'Why: a b; c d.'
    """
    sentences = [f"{begin}:"]
    for i, part in enumerate(dict.fromkeys(parts)):
        longer = f"{sentences[-1]}{';' if i else ''} {part}"
        if i and len(longer.split()) > SENTENCE_WORDS:
            sentences.append(f"{part[:1].upper()}{part[1:]}")
        else:
            sentences[-1] = longer
    return f"{'. '.join(sentences)}."
