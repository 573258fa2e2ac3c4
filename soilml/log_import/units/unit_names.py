"""Units as logs write them, in the spelling that pint reads."""

from __future__ import annotations

import re

#: Spellings that pint does not know, or reads as something else.
_SPELLINGS = {
    "nm": "N*m", "n-m": "N*m", "n.m": "N*m", "newton-meter": "N*m", "newton meter": "N*m",
    "mnm": "mN*m", "mn-m": "mN*m", "mn.m": "mN*m", "ncm": "N*cm", "n-cm": "N*cm", "n.cm": "N*cm",
    "knm": "kN*m", "nmm": "N*mm", "n-mm": "N*mm", "n.mm": "N*mm", "unm": "uN*m",
    "lb-ft": "lbf*ft", "ft-lb": "lbf*ft", "lbft": "lbf*ft", "ftlb": "lbf*ft", "in-lb": "lbf*inch",
    "lb-in": "lbf*inch", "lbs": "lbf", "kgf": "kgf", "kp": "kgf", "gf": "kgf/1000",
    "kgfcm": "kgf*cm", "kgf-cm": "kgf*cm", "kg-cm": "kgf*cm", "kgcm": "kgf*cm", "kgm": "kgf*m",
    "kgfm": "kgf*m", "kgf-m": "kgf*m",
    "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm", "u/min": "rpm", "r/min": "rpm",
    "rev/min": "rpm", "rpm": "rpm", "rps": "turn/s", "rev/s": "turn/s", "r/s": "turn/s",
    "tr/min": "rpm", "turns": "turn", "turn": "turn", "rev": "turn", "revs": "turn",
    "revolutions": "turn", "rot": "turn",
    "degs": "deg", "degree": "deg", "degrees": "deg", "grad": "deg", "°": "deg", "º": "deg",
    "dps": "deg/s", "deg/sec": "deg/s", "degps": "deg/s", "deg_s": "deg/s", "rads": "rad",
    "rad/sec": "rad/s", "radps": "rad/s", "rad_s": "rad/s", "radians": "rad", "radian": "rad",
    "mps": "m/s", "m/sec": "m/s", "m_s": "m/s", "mmps": "mm/s", "mm/sec": "mm/s", "mm_s": "mm/s",
    "cmps": "cm/s", "cm_s": "cm/s", "kph": "km/h", "kmh": "km/h", "mph": "mile/hour",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millis": "ms",
    "usec": "us", "micros": "us", "nsec": "ns", "nanos": "ns", "s": "s",
    "%": "percent", "pct": "percent", "percent": "percent", "prozent": "percent",
    "1": "dimensionless", "-": "dimensionless", "ratio": "dimensionless", "/": "dimensionless",
    "counts": "count", "count": "count", "cts": "count", "cnt": "count", "ticks": "count",
    "tick": "count", "inc": "count", "incs": "count", "pulses": "count", "pulse": "count",
    "qc": "count", "steps": "count", "counts/s": "count/s", "cps": "count/s", "ticks/s": "count/s",
    "inkr": "count", "inkremente": "count", "increments": "count", "impulse": "count",
    "imp": "count", "digits": "count", "digit": "count", "lsb": "count",
    "inc/s": "count/s", "qc/s": "count/s",
    "amps": "A", "amp": "A", "ampere": "A", "volts": "V", "volt": "V", "newton": "N",
    "newtons": "N", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "c": "degC",
    "°c": "degC",
}  # fmt: skip
#: Spellings in which capitals matter, because small letters mean something else.
_EXACT = {"mNm": "mN*m", "MNm": "MN*m", "Nm": "N*m", "kNm": "kN*m", "G": "g_0", "mA": "mA"}
#: Units that a log may write in a header without brackets, at the end of a name.
_SUFFIXES = (
    "deg_s rad_s m_s mm_s cm_s m_s2 counts ticks rpm mnm nm rad deg degs mm cm ma ms us ns sec "
    "secs percent pct kgf mps mmps rps dps radps n m a s kg kn turns rev v lbf degps ncm newton "
    "newtons amps inc mn mm_min cm_min m_min mv uv"
)
#: Per cent of something that a data sheet states.
_SHARE = re.compile(
    r"(?:%|pct|percent|prozent)[ _]*(?:(?:of|von|vom)\b.*|rated\b.*|nominal\b.*|nenn.*|f\.?s\.?)",
    re.IGNORECASE,
)
_POWER = re.compile(r"([A-Za-z]+)\s*(?:\^|\*\*)?\s*(-?\d)(?!\d)")


def spelling(unit: str) -> str:
    """The unit in the spelling that pint reads; unknown units are returned with little change."""
    text = unit.strip().strip("[](){}").strip()
    if text in _EXACT:
        return _EXACT[text]
    if _SHARE.fullmatch(text):
        return "percent"
    text = text.replace("µ", "u").replace("μ", "u").replace("·", "*").replace("⋅", "*")
    text = text.replace("²", "^2").replace("⁻¹", "^-1").replace("⁻", "^-").replace("×", "*")
    if text.lower() in _SPELLINGS and not (text[:1] == "M" and text.lower()[0] == "m"):
        return _SPELLINGS[text.lower()]
    text = text.replace("°", "deg").replace("º", "deg")
    if text.lower() in _SPELLINGS:
        return _SPELLINGS[text.lower()]
    parts = re.split(r"([*/ ])", text)
    parts = [p if p in ("1", "-", "/", "C") else _SPELLINGS.get(p.lower(), p) for p in parts]
    text = "".join(parts)
    text = _POWER.sub(r"\1**\2", text)
    return re.sub(r"(?<=[\w)])\s+(?=\w)", "*", text)


def unit_in_name(name: str) -> str:
    """The unit that ends a name such as torque_Nm, v_mm_s or current_mA; "" without one."""
    words = re.split(r"[_\s.\-]+", name)
    for count in (2, 1):
        tail = words[-count:]
        if len(words) > count and "_".join(tail).lower() in _SUFFIXES.split():
            text = (
                "/".join(tail) if count == 2 and tail[-1] in ("s", "s2", "min") else "_".join(tail)
            )
            if len(text) == 1 and text.islower() and text in ("a", "n", "v"):
                continue  # an axis or an index rather than a unit
            return text.replace("s2", "s^2")
    return ""


def is_raw_signal(unit: str) -> bool:
    """Whether a unit is that of a sensor before its calibration: volts, mV/V, counts."""
    text = spelling(unit)
    return text in ("V", "mV", "uV", "kV", "count") or re.fullmatch(r"[mu]?V/V", text) is not None


def known_unit(text: str) -> bool:
    """Whether a text is a unit: pint reads it in the spelling of logs."""
    from soilml.log_import.units.conversion import dimension

    return len(text) <= 16 and dimension(text) is not None
