"""Numbers, units and names as reports and tables show them: rounded to what is known of them."""

from __future__ import annotations

import math
from typing import Protocol

from soilml.quantities import COLUMNS

_SUPERSCRIPT = str.maketrans("0123456789+-n()", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ  ")
#: SI unit -> factor and display unit; moduli in N/m^(n+2) get a prefix by their size instead.
_DISPLAY_UNITS = {
    "Pa": (1e-3, "kPa"),
    "rad": (180.0 / math.pi, "°"),
    "m": (1e3, "mm"),
    "N/m^3": (1e-3, "kN/m^3"),
}
_VARIANCE_COMPONENTS = {
    "friction_angle_std": ("friction angle from run to run, std", 180.0 / math.pi, "°"),
    "bearing_std": ("bearing strength from run to run, std", 100.0, " %"),
    "autocorrelation": ("correlation of neighbouring samples", 1.0, ""),
}
_SYMBOLS = {"theta_1": "θ₁", "k_phi": "k_φ", "k_c": "k_c", "phi": "φ", "gamma": "γ", "a_0": "a₀"}
_NAMES = {
    "kc": "cohesive modulus of sinkage",
    "kphi": "frictional modulus of sinkage",
    "n": "exponent of sinkage",
    "a0": "angle of maximum stress",
    "a1": "its growth with slip",
}
_SYMBOLS |= {"a_1": "a₁"}


class Estimated(Protocol):
    """An estimate in an SI unit, with its standard deviation."""

    @property
    def value(self) -> float:
        """The estimate."""

    @property
    def std(self) -> float:
        """Its standard deviation."""

    @property
    def unit(self) -> str:
        """Unit of both."""


#: Significant digits of estimates in files: a millionth of the value is far below any uncertainty.
SIGNIFICANT_DIGITS = 6


def decimal(value: float, digits: int = 3) -> str:
    """A number with this many significant digits, never with a power of ten."""
    if not math.isfinite(value):
        return f"{value:g}"
    exponent = 0 if value == 0.0 else math.floor(math.log10(abs(value)))
    return f"{value:.{max(0, digits - 1 - exponent)}f}"


def format_residual(x: float, digits: int = 3) -> str:
    """A mean squared residual; one far below that of noise is given as an upper limit."""
    return "< 0.001" if 0.0 <= x < 1e-3 else format_number(x, digits)


def share_left(fraction: float) -> str:
    """The share of a prior's width that remains: 92% of; all of, from a whole on."""
    return f"{fraction:.0%} of" if round(fraction, 2) < 1.0 else "all of"


def format_number(x: float, digits: int = 3) -> str:
    """A number to this many significant digits: 320, 1.00, 0.0832, 1.2 × 10⁷; a dash for NaN."""
    if math.isnan(x):
        return "–"
    if math.isinf(x):
        return "∞" if x > 0 else "−∞"
    if x != 0.0 and not 1e-3 <= abs(x) < 1e6:
        mantissa, _, exponent = f"{x:.{digits - 1}e}".partition("e")
        return _minus(f"{mantissa} × 10{_raised(int(exponent))}")
    return _minus(decimal(x, digits))


def format_gain(x: float) -> str:
    """A difference of objectives: one decimal, none from a thousand on."""
    if not math.isfinite(x):
        return format_number(x)
    return _minus(f"{x:.0f}" if abs(x) >= 999.95 else f"{x + 0.0:.1f}").replace("−0.0", "0.0")


def format_log_density(gain: float, std_error: float | None) -> str:
    """A difference of log densities, with its standard error where that is known: +5.1 +- 0.4."""
    return f"{gain:+.1f}" + ("" if std_error is None else f" +- {std_error:.1f}")


def format_p_value(p: float) -> str:
    """A p value, to at most two digits."""
    text = "p < 0.001" if p < 1e-3 else f"p = {p:.2f}" if p >= 0.1 else f"p = {p:.2g}"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def format_with_std(value: float, std: float) -> str:
    """Value ± standard deviation, both to the second significant digit of the latter."""
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return format_number(value, 4)
    decimals = 1 - math.floor(math.log10(std))
    if -3 < decimals < 5:
        places = max(0, decimals)
        return _minus(f"{value:.{places}f} ± {std:.{places}f}")
    power = math.floor(math.log10(max(abs(value), std)))
    inside = (
        f"{value / 10.0**power:.{decimals + power}f} ± {std / 10.0**power:.{decimals + power}f}"
    )
    return _minus(f"({inside}) × 10{_raised(power)}")


def format_interval(low: float, high: float, std: float) -> str:
    """Both ends to the second significant digit of the standard deviation: 0.85 to 1.24."""
    ends = [format_with_std(end, std).split(" ± ")[0].lstrip("(") for end in (low, high)]
    power = format_with_std(low, std).rpartition(") ")[2]
    text = f"{ends[0]} to {ends[1]}"
    if not power.startswith("×"):
        return text
    return f"{format_number(low, 3)} to {format_number(high, 3)}"


def format_change(x: float, std: float) -> str:
    """A change with its sign, to the second significant digit of its standard deviation."""
    decimals = 1 - math.floor(math.log10(std)) if std > 0.0 and math.isfinite(std) else 3
    return _minus(f"{x:+.{min(max(0, decimals), 6)}f}") if math.isfinite(x) else format_number(x)


def display_unit(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit in which values of this size are shown."""
    factor, name = _DISPLAY_UNITS.get(unit, (1.0, unit))
    if unit.startswith("N/m^("):
        factor, prefix = next(
            ((1.0 / f, p) for f, p in ((1e6, "M"), (1e3, "k")) if abs(size) >= f), (1.0, "")
        )
        name = prefix + unit
    return factor, format_unit(name)


def format_unit(unit: str) -> str:
    """A unit with superscript exponents; empty for a dimensionless number."""
    if unit in ("1", "-", ""):
        return ""
    base, caret, exponent = unit.partition("^")
    return base + (exponent.translate(_SUPERSCRIPT).replace(" ", "") if caret else "")


def format_estimate(value: Estimated) -> str:
    """An estimate ± standard deviation in its display unit."""
    factor, unit = display_unit(value.unit, value.value)
    return with_unit(format_with_std(factor * value.value, factor * value.std), unit)


def format_quantity(value: float, unit: str) -> str:
    """A number in an SI unit, in the display unit of its kind."""
    factor, shown = display_unit(unit, abs(value))
    return with_unit(format_number(factor * value), shown)


def format_in_si(value: Estimated) -> str:
    """The same in SI units; empty where that is the display unit."""
    factor, _ = display_unit(value.unit, value.value)
    if factor == 1.0:
        return ""
    return with_unit(format_with_std(value.value, value.std), format_unit(value.unit))


def with_unit(number: str, unit: str) -> str:
    """A number and its unit."""
    return number + ("" if unit in ("", "°") else "\N{NO-BREAK SPACE}") + unit


def channel_name(name: str) -> str:
    """A channel in words, from its column: `drawbar_pull_N` -> drawbar pull."""
    return _words(COLUMNS[name].name) if name in COLUMNS else name


def channel_unit(name: str) -> tuple[float, str]:
    """Factor and unit in which a channel is plotted."""
    unit = COLUMNS[name].unit if name in COLUMNS else ""
    return display_unit(unit, 1.0)


def parameter_name(path: str) -> str:
    """A parameter in words, with its symbol: `friction_angle` -> friction angle φ."""
    for quantity in COLUMNS.values():
        if quantity.name == path:
            symbol = _SYMBOLS.get(quantity.symbol, quantity.symbol)
            return f"{_NAMES.get(path, _words(path))} {symbol}".strip()
    return path


def format_range(low: float, high: float, digits: int = 3) -> str:
    """A range, or a single value where both ends agree."""
    one, two = (_trimmed(format_number(x, digits)) for x in (low, high))
    return one if one == two else f"{one} to {two}" if low < 0.0 else f"{one}–{two}"


def capitalised(text: str) -> str:
    """The text as the beginning of a sentence; symbols, files and commands stay."""
    first = text.split(" ", 1)[0].rstrip(":,;.")
    word = len(first) > 1 and first.isalpha() and first != "soilml"
    return text[0].upper() + text[1:] if word or first == "a" else text


def format_variance_component(key: str, value: float) -> tuple[str, str]:
    """Name and size of a variance component."""
    scale = "noise_scale_"
    if key.startswith(scale):
        return (
            f"noise of {channel_name(key[len(scale) :])}",
            f"{format_number(value, 2)} × the declared noise",
        )
    name, factor, unit = _VARIANCE_COMPONENTS.get(key, (_words(key), 1.0, ""))
    return name, f"{format_number(factor * value, 2)}{unit}" if value != 0.0 else "none"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _raised(power: int) -> str:
    return str(power).translate(_SUPERSCRIPT)


def _minus(text: str) -> str:
    return text.replace("-", "−")


def _trimmed(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text and "×" not in text else text


#: Probability below which only a bound is shown.
LEAST_STATED = 0.005


def format_probability(p: float) -> str:
    """A probability with two digits; near 0 and 1 as a bound."""
    if p < LEAST_STATED:
        return "< 0.01"
    return "> 0.99" if p > 0.995 else f"{p:.2f}"


def significant(value: float, digits: int = SIGNIFICANT_DIGITS) -> float:
    """A number rounded to significant digits.

    >>> significant(0.05407576875886196), significant(45769539.457, 4)
    (0.0540758, 45770000.0)
    """
    return float(f"{value:.{digits}g}")
