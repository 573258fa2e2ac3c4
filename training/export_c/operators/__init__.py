"""ONNX operators as C: every operator that export c knows, by its name."""

from __future__ import annotations

from training.export_c.operators import combination, elementwise, rearrangement
from training.export_c.program import Translation

OPERATORS: dict[str, Translation] = {
    **elementwise.OPERATORS,
    **combination.OPERATORS,
    **rearrangement.OPERATORS,
}
