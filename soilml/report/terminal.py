"""Numbers and units as a terminal shows them: kPa, degrees, mm; as many digits as are known."""

from __future__ import annotations

import math
import re

from soilml.report.numbers import decimal

#: SI unit -> factor and unit on a terminal.
_UNITS = {"Pa": (1e-3, "kPa"), "rad": (180.0 / math.pi, "deg"), "m": (1e3, "mm")}
#: Such a unit in the name of a column: torque_Nm and speed_m_s are left.
_UNIT_IN_COLUMN = re.compile(r"_(Pa|rad|m)(?!_s2?(?:_|$))(?=_|$)")
_LEAST, _MOST = 1e-4, 1e7  # Sizes outside which a number is written with a power of ten


def shown_unit(unit: str, size: float = 0.0) -> tuple[float, str]:
    """Factor and unit in which values of this SI unit are shown; moduli by their size.

    >>> shown_unit("Pa")
    (0.001, 'kPa')
    >>> shown_unit("N/m^(n+2)", 1.5e6)
    (1e-06, 'MN/m^(n+2)')
    """
    if unit.startswith("N/m^("):
        for factor, prefix in ((1e6, "M"), (1e3, "k")):
            if abs(size) >= factor:
                return 1.0 / factor, prefix + unit
    if unit == "Pa/m":
        return 1e-3, "kPa/m"
    return _UNITS.get(unit, (1.0, "" if unit in ("1", "-") else unit))


def shown_column(name: str) -> tuple[float, str]:
    """Factor and name under which a column is shown.

    >>> shown_column("cohesion_Pa_std")
    (0.001, 'cohesion_kPa_std')
    >>> shown_column("speed_m_s")
    (1.0, 'speed_m_s')
    """
    found = _UNIT_IN_COLUMN.search(name)
    if found is None:
        return 1.0, name
    factor, unit = _UNITS[found[1]]
    return factor, f"{name[: found.start(1)]}{unit}{name[found.end(1) :]}"


def significant(x: float, digits: int = 4) -> str:
    """A number to at most this many significant digits, without trailing zeros; blank for NaN.

    >>> [significant(x) for x in (12345.6, 0.1, 0.0, 2.5e-7)]
    ['12346', '0.1', '0', '2.5e-07']
    """
    if math.isnan(x):
        return ""
    if math.isinf(x) or (x != 0.0 and not _LEAST <= abs(x) < _MOST):
        return f"{x:.{digits}g}"
    text = decimal(x, digits)
    return text.rstrip("0").rstrip(".") if "." in text else text


def rounded(x: float, std: float) -> str:
    """A number to the second significant digit of its standard deviation.

    >>> rounded(1043.21, 118.0), rounded(27.3271, 0.074), rounded(0.5, 0.0)
    ('1040', '27.327', '0.5')
    """
    if not (math.isfinite(x) and math.isfinite(std)) or std <= 0.0:
        return significant(x)
    if max(abs(x), std) >= _MOST or max(abs(x), std) < _LEAST:
        return f"{x:.3g}"
    decimals = 1 - math.floor(math.log10(std))
    if decimals > 9:
        return significant(x, 6)
    return f"{round(x, decimals) + 0.0:.{max(0, decimals)}f}"


def interval(low: float, high: float, std: float) -> str:
    """Both ends, to the second significant digit of the standard deviation."""
    return f"{rounded(low, std)} .. {rounded(high, std)}"
