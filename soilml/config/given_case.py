"""A case that functions take as such, or by the path of its model file."""

from __future__ import annotations

import os
from typing import TypeAlias

from soilml.config.case import Case, read_case
from soilml.config.explanations import one_of

GivenCase: TypeAlias = Case | str | os.PathLike[str]


def as_case(case: GivenCase, with_bias: bool = True, with_explanations: bool = True) -> Case:
    """The case, read where it is a path; raises `InputError` as `read_case` does."""
    if isinstance(case, str | os.PathLike):
        return read_case(case, with_bias=with_bias, with_explanations=with_explanations)
    return case if with_explanations else one_of(case, "the case")
