"""The gap workflow: where model and measurements disagree, and what is missing from the model."""

from soilml.gap.audit import Audit, audit
from soilml.gap.report import STATUSES, GapReport
from soilml.gap.workflow import gap

__all__ = ["STATUSES", "Audit", "GapReport", "audit", "gap"]
