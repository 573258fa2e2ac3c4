"""The gap workflow: where model and measurements disagree, and what is missing from the model."""

from soilml.gap.design.identifiability_audit import Audit, audit
from soilml.gap.results import STATUSES, GapReport
from soilml.gap.workflow import gap

__all__ = ["STATUSES", "Audit", "GapReport", "audit", "gap"]
