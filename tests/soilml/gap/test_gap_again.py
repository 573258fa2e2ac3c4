"""A gap analysis of its own returned model, with the same rows and with others."""

from dataclasses import replace

from gap_sets import case_of, driven

from soilml.config.remainder import Remainder, RemainderPart
from soilml.gap import gap

PART = RemainderPart(
    "torque_Nm", "", 0.2, 0.1, 0.3, 0.6, (0.1, 0.6), (40.0, 90.0),
    ((0.3, 60.0),), (1.0,), ((0.5,),), ((0.0,),),
)  # fmt: skip


def test_a_remainder_that_was_learned_from_the_rows_is_left_out_and_a_note_says_so():
    case, table = case_of(), driven(case_of())
    learned = Remainder((PART,))
    report = gap(replace(case, remainder=learned.of_rows(table)), table)
    assert "same-rows" in {note.code for note in report.notes}
    assert report.model.remainder == gap(case, table).model.remainder
    other = gap(replace(case, remainder=learned.of_rows(table.rows(slice(0, 0)))), table)
    assert "same-rows" not in {note.code for note in other.notes}
    assert other.model.remainder.parts[0] == PART
