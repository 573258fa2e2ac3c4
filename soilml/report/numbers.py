"""Numbers, units and names as people read them: kPa, degrees, mm; as many digits as are known.

Texts are plain, as a terminal shows them: `+-`, `deg`, `N/m^(n+2)`; `pretty` is for pages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from soilml.quantities import COLUMNS, QUANTITIES

#: SI unit -> factor and unit that is shown; moduli in N/m^(n+2) get a prefix by their size instead.
_UNITS = {
    "Pa": (1e-3, "kPa"),
    "rad": (180.0 / math.pi, "deg"),
    "m": (1e3, "mm"),
    "Pa/m": (1e-3, "kPa/m"),
    "N/m^3": (1e-3, "kN/m^3"),
    "share": (100.0, "%"),
    "1": (1.0, ""),
    "-": (1.0, ""),
}
#: A unit at the end of a column's name.
_UNIT_IN_COLUMN = re.compile(r"_(J_per_m|kg_m3|N_m3|m_s2|m_s|rad_s|Nm|Pa|rad|m2|mm|kg|deg|m|N|s)$")
_WRITTEN = {"Nm": "N m", "m_s": "m/s", "m_s2": "m/s^2", "N_m3": "N/m^3", "rad_s": "rad/s"}
_WRITTEN |= {"m2": "m^2", "J_per_m": "J/m", "kg_m3": "kg/m^3"}
_LEAST, _MOST = 1e-4, 1e7  # Sizes outside which a number is written with a power of ten
_NAMES = {
    "kc": "cohesive modulus of sinkage",
    "kphi": "frictional modulus of sinkage",
    "n": "exponent of sinkage",
    "a0": "angle of maximum stress",
    "a1": "its growth with slip",
}
SIGNIFICANT_DIGITS = 6  # Digits of estimates in files, which are far below any uncertainty
LEAST_STATED = 0.005  # Probability below which only a bound is stated

_RAISED = str.maketrans("0123456789+-n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ")
_SYMBOLS = {"theta_1": "θ₁", "k_phi": "k_φ", "phi": "φ", "gamma": "γ", "a_0": "a₀", "a_1": "a₁"}
#: What `pretty` replaces, in this order.
_PRETTY: tuple[tuple[str, Callable[[re.Match[str]], str]], ...] = (
    (r"\^\(?([-+n\d]+)\)?", lambda found: found[1].translate(_RAISED)),
    (r"(?<=\d)e(-?)\+?0*(\d+)\b", lambda f: f" × 10{(f[1] + f[2]).translate(_RAISED)}"),
    (r"(?<=\d) deg\b|\bdeg\b", lambda _: "°"),
    (r"(?<![\w.)-])-(?=\d)", lambda _: "−"),
    (r"\+-", lambda _: "±"),
    (r"->", lambda _: "→"),
    (rf"(?<![\w.])(?:{'|'.join(_SYMBOLS)})(?![\w.])", lambda found: _SYMBOLS[found[0]]),
)


def pretty(text: str) -> str:
    """A text for a page: ±, minus signs, raised exponents and degrees.

    >>> pretty("k_phi = 1.9 +- 0.2 MN/m^(n+2), 1.2e-07 Pa, -3 deg")
    'k_φ = 1.9 ± 0.2 MN/mⁿ⁺², 1.2 × 10⁻⁷ Pa, −3°'
    """
    for pattern, by in _PRETTY:
        text = re.sub(pattern, by, text)
    return text


def shown_unit(unit: str, size: float = 0.0) -> tuple[float, str]:
    """Factor and unit in which values of this SI unit are shown; moduli by their size.

    >>> shown_unit("Pa"), shown_unit("N/m^(n+2)", 1.5e6)
    ((0.001, 'kPa'), (1e-06, 'MN/m^(n+2)'))
    """
    if unit.startswith("N/m^("):
        for factor, prefix in ((1e6, "M"), (1e3, "k")):
            if abs(size) >= factor:
                return 1.0 / factor, prefix + unit
    return _UNITS.get(unit, (1.0, unit))


def shown_column(name: str) -> tuple[float, str]:
    """Factor and heading under which a column of a table in SI units is shown.

    >>> shown_column("sinkage_m"), shown_column("drawbar_pull_N"), shown_column("slip")
    ((1000.0, 'sinkage, mm'), (1.0, 'drawbar pull, N'), (1.0, 'slip'))
    """
    found = _UNIT_IN_COLUMN.search(name)
    if found is None:
        return 1.0, name.replace("_", " ")
    factor, unit = _UNITS.get(found[1], (1.0, _WRITTEN.get(found[1], found[1])))
    return factor, f"{name[: found.start()].replace('_', ' ')}, {unit}"


def decimal(value: float, digits: int = 3) -> str:
    """A number with this many significant digits, never with a power of ten."""
    if not math.isfinite(value):
        return f"{value:g}"
    exponent = 0 if value == 0.0 else math.floor(math.log10(abs(value)))
    return f"{value:.{max(0, digits - 1 - exponent)}f}"


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


def round_significant(value: float, digits: int = SIGNIFICANT_DIGITS) -> float:
    """A number rounded to significant digits.

    >>> round_significant(0.05407576875886196), round_significant(45769539.457, 4)
    (0.0540758, 45770000.0)
    """
    return float(f"{value:.{digits}g}")


def rounded(x: float, std: float, digits: int = 4) -> str:
    """A number to the second significant digit of its standard deviation.

    >>> rounded(1043.21, 118.0), rounded(27.3271, 0.074), rounded(0.5, 0.0)
    ('1040', '27.327', '0.5')
    """
    if not (math.isfinite(x) and math.isfinite(std)) or std <= 0.0:
        return significant(x, digits)
    if max(abs(x), std) >= _MOST or max(abs(x), std) < _LEAST:
        return f"{x:.3g}"
    decimals = 1 - math.floor(math.log10(std))
    if decimals > 9:
        return significant(x, 6)
    return f"{round(x, decimals) + 0.0:.{max(0, decimals)}f}"


def format_quantity(
    value: float,
    unit: str = "1",
    std: float = 0.0,
    ends: tuple[float, float] | None = None,
    digits: int = 3,
) -> str:
    """A number in an SI unit with what is known of it, in the unit that is shown.

    ends: Ends of its 90 % interval.

    >>> format_quantity(1255.4, "Pa", 794.3, (210.0, 2600.0))
    '1.26 +- 0.79 kPa (90 %: 0.21 to 2.60)'
    >>> format_quantity(0.4, "rad")
    '22.9 deg'
    """
    factor, shown = shown_unit(unit, abs(value))
    width = std if std > 0.0 or ends is None else (ends[1] - ends[0]) / 3.3
    text = rounded(factor * value, factor * width, digits)
    if std > 0.0 and math.isfinite(std):
        text += f" +- {rounded(factor * std, factor * std)}"
    text = f"{text} {shown}".rstrip() if shown != "%" else f"{text} %"
    if ends is None or not all(map(math.isfinite, ends)):
        return text
    low, high = (rounded(factor * end, factor * width, digits) for end in ends)
    return f"{text} (90 %: {low} to {high})"


def format_band(low: float, middle: float, high: float, unit: str = "1", digits: int = 3) -> str:
    """A median in an SI unit with the ends of its 90 % band.

    >>> format_band(0.1, 0.2, 0.3, "rad")
    '11.5 deg (90 %: 5.7 to 17.2)'
    """
    return format_quantity(middle, unit, ends=(low, high), digits=digits)


def format_residual(x: float) -> str:
    """A mean squared residual; one far below that of noise is given as an upper limit."""
    return "< 0.001" if 0.0 <= x < 1e-3 else decimal(x, 3)


def share_left(fraction: float) -> str:
    """The share of a prior's width that remains: 92% of; all of, from a whole on."""
    return f"{fraction:.0%} of" if round(fraction, 2) < 1.0 else "all of"


def format_probability(p: float) -> str:
    """A probability with two digits; near 0 and 1 as a bound."""
    if p < LEAST_STATED:
        return "< 0.01"
    return "> 0.99" if p > 0.995 else f"{p:.2f}"


def format_range(low: float, high: float, digits: int = 3) -> str:
    """A range, or a single value where both ends agree."""
    one, two = significant(low, digits), significant(high, digits)
    return one if one == two else f"{one} to {two}"


def with_unit(name: str, unit: str) -> str:
    """A name and the unit that is shown for it, for axes and headings: torque, N m."""
    return f"{name}, {unit}" if unit else name


def channel_name(name: str) -> str:
    """A channel in words, from its column: `drawbar_pull_N` -> drawbar pull."""
    return (COLUMNS[name].name if name in COLUMNS else name).replace("_", " ")


def channel_unit(name: str) -> tuple[float, str]:
    """Factor and unit in which a channel is shown."""
    return shown_unit(COLUMNS[name].unit) if name in COLUMNS else (1.0, "")


def parameter_name(path: str) -> str:
    """A parameter in words, with its symbol: `friction_angle` -> friction angle phi."""
    if path not in QUANTITIES:
        return path
    return f"{_NAMES.get(path, path.replace('_', ' '))} {QUANTITIES[path].symbol}".strip()


def capitalised(text: str) -> str:
    """The text as the beginning of a sentence; symbols, files, commands and `name:` stay.

    >>> capitalised("two runs"), capitalised("rate: needs speed_m_s"), capitalised("n = 1.1")
    ('Two runs', 'rate: needs speed_m_s', 'n = 1.1')
    """
    first = text.split(" ", 1)[0].rstrip(",;.")
    word = len(first) > 1 and first.isalpha() and first not in ("soilml", "ln")
    return text[0].upper() + text[1:] if word or first == "a" else text
