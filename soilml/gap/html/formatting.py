"""Numbers, units and names as people read them."""

from __future__ import annotations

import math

from soilml.gap.results import EstimatedValue
from soilml.quantities import COLUMNS

_SUPERSCRIPT = str.maketrans("0123456789+-n()", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ  ")
#: SI unit -> factor and unit that people use; those of bearing are prefixed by size instead.
_HANDY = {
    "Pa": (1e-3, "kPa"),
    "rad": (180.0 / math.pi, "°"),
    "m": (1e3, "mm"),
    "N/m^3": (1e-3, "kN/m^3"),
}
_SCATTER = {
    "friction_angle_from_run_to_run_rad": (
        "friction angle from run to run, std",
        180.0 / math.pi,
        "°",
    ),
    "bearing_from_run_to_run": ("bearing strength from run to run, std", 100.0, " %"),
    "memory_of_samples": ("correlation of neighbouring samples", 1.0, ""),
}
_SYMBOLS = {"theta_1": "θ₁", "k_phi": "k_φ", "k_c": "k_c", "phi": "φ", "gamma": "γ", "a_0": "a₀"}
_NAMES = {
    "kc": "cohesive modulus of sinkage",
    "kphi": "frictional modulus of sinkage",
    "n": "exponent of sinkage",
    "a0": "angle of most stress",
    "a1": "its growth with slip",
}
_SYMBOLS |= {"a_1": "a₁"}


def figure(x: float, digits: int = 3) -> str:
    """A number to so many digits that count: 320, 1.00, 0.0832, 1.2 × 10⁷; a dash for none."""
    if math.isnan(x):
        return "–"
    if math.isinf(x):
        return "∞" if x > 0 else "−∞"
    if x != 0.0 and not 1e-3 <= abs(x) < 1e6:
        mantissa, _, exponent = f"{x:.{digits - 1}e}".partition("e")
        return _minus(f"{mantissa} × 10{_raised(int(exponent))}")
    before = 1 if x == 0.0 else 1 + math.floor(math.log10(abs(x)))
    return _minus(f"{x:.{max(0, digits - before)}f}")


def gain(x: float) -> str:
    """A difference of objectives: to a tenth, without decimals from a thousand on."""
    if not math.isfinite(x):
        return figure(x)
    return _minus(f"{x:.0f}" if abs(x) >= 999.95 else f"{x + 0.0:.1f}").replace("−0.0", "0.0")


def chance(p: float) -> str:
    """A p value, to two digits at most."""
    text = "p < 0.001" if p < 1e-3 else f"p = {p:.2f}" if p >= 0.1 else f"p = {p:.2g}"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def spread(value: float, std: float) -> str:
    """Value and standard deviation, both to the second digit of the latter."""
    if not (math.isfinite(value) and math.isfinite(std)) or std <= 0.0:
        return figure(value, 4)
    decimals = 1 - math.floor(math.log10(std))
    if -3 < decimals < 5:
        places = max(0, decimals)
        return _minus(f"{value:.{places}f} ± {std:.{places}f}")
    power = math.floor(math.log10(max(abs(value), std)))
    inside = (
        f"{value / 10.0**power:.{decimals + power}f} ± {std / 10.0**power:.{decimals + power}f}"
    )
    return _minus(f"({inside}) × 10{_raised(power)}")


def difference(x: float, std: float) -> str:
    """A change with its sign, to the second digit of what it is uncertain by."""
    decimals = 1 - math.floor(math.log10(std)) if std > 0.0 and math.isfinite(std) else 3
    return _minus(f"{x:+.{min(max(0, decimals), 6)}f}") if math.isfinite(x) else figure(x)


def handy(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit for values of about that size."""
    factor, name = _HANDY.get(unit, (1.0, unit))
    if unit.startswith("N/m^("):
        factor, prefix = next(
            ((1.0 / f, p) for f, p in ((1e6, "M"), (1e3, "k")) if abs(size) >= f), (1.0, "")
        )
        name = prefix + unit
    return factor, written(name)


def written(unit: str) -> str:
    """A unit with raised exponents; nothing for a pure number."""
    if unit in ("1", "-", ""):
        return ""
    base, caret, exponent = unit.partition("^")
    return base + (exponent.translate(_SUPERSCRIPT).replace(" ", "") if caret else "")


def shown(value: EstimatedValue) -> str:
    """A value with its standard deviation in a handy unit."""
    factor, unit = handy(value.unit, value.value)
    return joined(spread(factor * value.value, factor * value.std), unit)


def in_si(value: EstimatedValue) -> str:
    """The same in SI, where that is another unit; else nothing."""
    factor, _ = handy(value.unit, value.value)
    if factor == 1.0:
        return ""
    return joined(spread(value.value, value.std), written(value.unit))


def joined(number: str, unit: str) -> str:
    """A number and its unit."""
    return number + ("" if unit in ("", "°") else "\N{NO-BREAK SPACE}") + unit


def channel(name: str) -> str:
    """A channel in words, from its column: `drawbar_pull_N` -> drawbar pull."""
    return _words(COLUMNS[name].name) if name in COLUMNS else name


def channel_unit(name: str) -> tuple[float, str]:
    """Factor and unit in which a channel is drawn."""
    unit = COLUMNS[name].unit if name in COLUMNS else ""
    return handy(unit, 1.0)


def parameter(path: str) -> str:
    """A parameter in words, with its symbol: `friction_angle` -> friction angle φ."""
    for quantity in COLUMNS.values():
        if quantity.name == path:
            symbol = _SYMBOLS.get(quantity.symbol, quantity.symbol)
            return f"{_NAMES.get(path, _words(path))} {symbol}".strip()
    return path


def between(low: float, high: float, digits: int = 3) -> str:
    """A range, or the one value that it holds."""
    one, two = (_trimmed(figure(x, digits)) for x in (low, high))
    return one if one == two else f"{one} to {two}" if low < 0.0 else f"{one}–{two}"


def scattered(key: str, value: float) -> tuple[str, str]:
    """One figure of the scatter that was found: what it is, and its size."""
    scale = "noise_scale_"
    if key.startswith(scale):
        return f"noise of {channel(key[len(scale) :])}", f"{figure(value, 2)} × what was declared"
    name, factor, unit = _SCATTER.get(key, (_words(key), 1.0, ""))
    return name, f"{figure(factor * value, 2)}{unit}" if value != 0.0 else "none found"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _raised(power: int) -> str:
    return str(power).translate(_SUPERSCRIPT)


def _minus(text: str) -> str:
    return text.replace("-", "−")


def _trimmed(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text and "×" not in text else text
