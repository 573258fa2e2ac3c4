"""Gap analysis: where a model disagrees with measurements, and which effect it lacks.

`gap` analyses measured rows and returns a `GapReport`, whose status is one of `STATUSES`; `audit`
determines which effects an experimental design could identify. The module itself can be called as
the function: `from soilml import gap` gives either of them, depending on what was imported before.
"""

import sys
from types import ModuleType

from soilml.gap.identifiability import Audit, audit
from soilml.gap.results import GapReport
from soilml.gap.statuses import STATUSES
from soilml.gap.workflow import gap

__all__ = ["STATUSES", "Audit", "GapReport", "audit", "gap"]


class _CallableModule(ModuleType):
    """A module that is called as its function `gap`."""

    __call__ = staticmethod(gap)


sys.modules[__name__].__class__ = _CallableModule
