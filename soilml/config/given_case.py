"""A case that functions take as such, or by the path of its model file."""

from __future__ import annotations

import os
from typing import TypeAlias

from soilml.config.case import Case, read_case

GivenCase: TypeAlias = Case | str | os.PathLike[str]


def as_case(case: GivenCase, with_bias: bool = True) -> Case:
    """The case, read where it is a path; raises `InputError` as `read_case` does."""
    return read_case(case, with_bias=with_bias) if isinstance(case, str | os.PathLike) else case
