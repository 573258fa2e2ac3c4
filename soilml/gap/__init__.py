"""Gap analysis: where a model disagrees with measurements, and which effect it lacks.

`gap` analyses measured rows and returns a `GapReport`, whose status is one of `STATUSES`; `audit`
determines which effects an experimental design could identify.
"""

from soilml.gap.design.identifiability import Audit, audit
from soilml.gap.report.results import STATUSES, GapReport
from soilml.gap.workflow import gap

__all__ = ["STATUSES", "Audit", "GapReport", "audit", "gap"]
