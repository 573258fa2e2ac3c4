"""Quantiles of the chi-squared distribution without a library of statistics."""

from __future__ import annotations


def chi_squared_quantile(degrees: float, normal_quantile: float) -> float:
    r"""The chi-squared value that is exceeded as rarely as a normal variable exceeds z.

    .. math:: n \left(1 - \frac{2}{9 n} + z \sqrt{\frac{2}{9 n}}\right)^3

    with n degrees of freedom, 0.5 or more. At z of 3 to 4 it is up to a tenth too large for one
    degree of freedom, and closer for more.

    References
    ----------
    Wilson and Hilferty, Proc. Natl. Acad. Sci. 17, 1931.

    Examples
    --------
    >>> round(chi_squared_quantile(20.0, 3.09), 1)  # exact: 45.31
    45.4
    """
    part = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - part + normal_quantile * part**0.5) ** 3)
