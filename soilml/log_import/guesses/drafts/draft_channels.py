"""Drafts of the channels of a wheel, checked on the samples of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns.candidates import Candidate
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.guesses.drafts.draft_inputs import inputs_of
from soilml.log_import.guesses.drafts.one_channel import draft_of, rotation_unit
from soilml.log_import.guesses.drafts.signs import sign_of_pull, sign_of_slip, signs
from soilml.log_import.guesses.drafts.tares import far_sinkage, lifted, tares
from soilml.log_import.guesses.stated_constants import stated_radius


def draft_channels(
    chosen: dict[str, Candidate],
    run: Run,
    stated: dict[str, tuple[str, str]],
    parts: Mapping[str, Sequence[Candidate]] | None = None,
) -> dict[str, Draft]:
    """Tables of the channels of one wheel, with units, signs and tares as the samples show them.

    `parts` are the further columns of a role: y and z, where the chosen place is x.
    """
    drafts = {
        role: draft_of(role, column, run, stated, (parts or {}).get(role, ()))
        for role, column in chosen.items()
    }
    rotation_unit(drafts, stated)
    inputs = inputs_of(drafts, run)
    if inputs is not None:
        signs(drafts, inputs)
        sign_of_slip(drafts, inputs)
        sign_of_pull(drafts, inputs)
        tares(drafts, inputs)
        far_sinkage(drafts, inputs, stated_radius(stated))
        lifted(drafts, inputs)
    return drafts
