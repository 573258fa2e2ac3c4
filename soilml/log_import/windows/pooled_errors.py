"""Standard errors of windows that borrow strength from each other."""

from __future__ import annotations

import numpy as np

from soilml.log_import.recording import Floats

#: Degrees of freedom of a window's own error, and those that the usual error counts with.
_OWN, _USUAL = 8.0, 4.0
#: Fewest windows that tell what is usual.
_FEWEST = 4


def pooled_errors(errors: Floats, lengths: Floats) -> Floats:
    r"""Errors (windows,) of means, each drawn to the usual one; NaN stay.

    .. math:: \tilde\sigma^2 = (\nu \sigma^2 + \nu_0 S / t) / (\nu + \nu_0)

    The error of one window comes from some ten independent pieces, and is by chance half or twice
    as large as it should be. S is the median over windows of the squared error times the length t,
    which does not depend on the length. From Smyth, "Linear models and empirical Bayes methods",
    Stat. Appl. Genet. Mol. Biol. 3 (2004), equation 6, here with fixed degrees of freedom.
    """
    known = np.isfinite(errors) & (errors > 0.0)
    if known.sum() < _FEWEST:
        return errors
    usual = float(np.median(errors[known] ** 2 * lengths[known]))
    with np.errstate(invalid="ignore"):
        pooled = np.sqrt((_OWN * errors**2 + _USUAL * usual / lengths) / (_OWN + _USUAL))
    return np.asarray(np.where(known, pooled, errors))
