"""How many channels of a rig a new map has right: `python guessed_channels.py [set_aside_rigs]`."""

import importlib
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
from foreign_rigs import RADIUS
from rig_tables import Truth

from soilml.errors import SoilmlError
from soilml.log_import import init_map
from soilml.log_import.channels.inputs import wheel_inputs
from soilml.log_import.channels.runs import runs_of
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.mapping.log_map import map_from
from soilml.log_import.readers import read_log
from soilml.optional_imports import tomllib

#: Quantity -> roles of a map that hold it, and the key of `Inputs.values`.
ROLES = {
    "rotation": (("wheel_speed", "wheel_angle"), "wheel_speed"),
    "travel": (("ground_speed", "position"), "ground_speed"),
    "slip": (("slip",), "slip"), "torque": (("torque",), "torque"),
    "current": (("motor_current",), "motor_current"), "load": (("load",), "load"),
    "pull": (("drawbar_pull",), "drawbar_pull"), "sinkage": (("sinkage",), "sinkage"),
}  # fmt: skip
#: Right and silent, right and marked, wrong and marked, wrong and silent.
RIGHT, LOOKED_AT, MARKED, SILENT = "right", "right, marked", "marked", "silent"


def judged(logs, truth: Truth, text=None):
    """Each channel and constant of a rig, and the channels that it does not hold but the map has:
    right, right but marked, wrong or absent but marked, wrong or absent in silence.
    """
    text = init_map(logs) if text is None else text
    content = tomllib.loads(text)
    filled = content | {"wheel": {"radius": RADIUS}}
    if "load" not in content:
        filled.setdefault("vehicle", {"mass": 1.0})
    roles = [role for roles, _ in ROLES.values() for role in roles]
    if not any(r in content or "wheels" in content for r in ("slip", *roles[:2])):
        filled["slip"] = {"value": 0.1}
    elif not {"slip", "ground_speed", "position"} & content.keys():
        filled["ground_speed"] = {"value": 0.1}
    found = {}
    try:
        log_map = map_from(filled)
        if truth.every_row:
            inputs = None
            columns = read_log(logs[0])[0].columns
        else:
            run = runs_of([read_log(log) for log in logs], log_map)[0]
            inputs = wheel_inputs(run, log_map.wheels[0])
    except SoilmlError as error:
        print("!", error)
        return dict.fromkeys((*truth.known.split(), *truth.constants), SILENT)
    wheel = log_map.wheels[0]
    for name in truth.known.split():
        own, key = ROLES[name]
        role = next((r for r in own if r in wheel.channels), None)
        right = role is not None and role not in (filled.keys() - content.keys())
        if right and name not in ("current",):
            true = truth.values(name)
            if inputs is None:
                channel = wheel.channels[role]
                values = sum(channel.scale * columns[c] for c in channel.columns)
                right = bool(channel.columns) and np.allclose(values, true, rtol=0.05, atol=1e-4)
            else:
                values = inputs.values.get(key)
                if values is None:
                    values = np.full(inputs.time.size, inputs.constants.get(key, np.nan))
                ratio = Conversion(wheel, None).constants.get(f"{role}.gear_ratio")
                values = values / (ratio.value if ratio else 1.0)
                right = same(inputs.time, values, truth, true)
        elif right:
            right = same_way(inputs.values[key], truth)
        marked = is_marked(text, own)
        found[name] = {(1, 0): RIGHT, (1, 1): LOOKED_AT, (0, 1): MARKED, (0, 0): SILENT}[
            right, marked
        ]
    for name in ("torque", "load", "pull", "sinkage"):
        role = ROLES[name][0][0]
        if name not in truth.known and role in content:
            found[f"no {name}"] = MARKED if is_marked(text, (role,)) else SILENT
    for name, value in truth.constants.items():
        found[name] = RIGHT if states(content, name, value) else MARKED
    return found


def same(time, values, truth, true):
    """Whether samples are the true ones while the wheel drives, but for noise and a zero."""
    d = truth.samples
    on = np.interp(time, d.t, (d.omega > 0.3 * d.omega.max()).astype(float)) > 0.99
    wanted = np.interp(time, d.t, true)[on]
    given = values[on]
    size = np.nanmedian(np.abs(wanted))
    zero = 0.006 if true is d.sinkage else 0.0
    return bool(np.nanmedian(np.abs(given - wanted)) < 0.08 * size + zero)


def same_way(values, truth):
    d = truth.samples
    n = min(values.size, d.t.size)
    return bool(abs(np.corrcoef(np.nan_to_num(values[:n]), d.torque[:n])[0, 1]) > 0.95)


def is_marked(text, roles):
    """Whether the table of a role, or what stands for it, has a line that is marked."""
    for role in roles:
        table = rf"^#? ?\[(?:wheels\.\w+\.)?{role}\].*?(?=\n\n|\Z)"
        for match in re.finditer(table, text, re.M | re.S):
            if "CHANGE" in match[0] or "NEEDED" in match[0]:
                return True
    needed = [part for part in text.split("\n\n") if "NEEDED" in part]
    return any(f"[{role}]" in part for role in roles for part in needed)


def states(content, name, value):
    """Whether a map has a constant, to a hundredth."""

    def number(given):
        text = str(given).split("+-")[0].strip()
        amount, _, unit = text.partition(" ")
        return float(amount) * {"mm": 1e-3, "cm": 1e-2, "kg": 1.0, "m": 1.0, "": 1.0}[unit.strip()]

    wheel = content.get("wheel", {})
    if name == "radius":
        if "radius" in wheel:
            return abs(number(wheel["radius"]) / value - 1) < 0.02
        return "diameter" in wheel and abs(number(wheel["diameter"]) / 2 / value - 1) < 0.02
    if name == "mass":
        mass = content.get("vehicle", {}).get("mass")
        return mass is not None and abs(number(mass) / value - 1) < 0.01
    tables = [t for t in content.values() if isinstance(t, dict)]
    tables += [t for w in content.get("wheels", {}).values() for t in w.values()
               if isinstance(t, dict)]  # fmt: skip
    return any(abs(t.get(name, 0) / value - 1) < 0.01 for t in tables)


def printed(capsys):
    """What a command printed, on one line."""
    return " ".join(" ".join(capsys.readouterr()).split())


def judged_rigs(module):
    """Rig -> judgement of each channel."""
    found = {}
    for writer in importlib.import_module(module).WRITERS:
        with tempfile.TemporaryDirectory() as folder:
            logs, truth = writer(np.random.default_rng(11), Path(folder))
            found[writer.__name__] = judged(logs, truth)
    return found


def main(module="described_rigs", detail="yes"):
    rigs = judged_rigs(module)
    every = [x for own in rigs.values() for x in own.values()]
    if detail == "yes":
        for name, own in rigs.items():
            wrong = {k: v for k, v in own.items() if v not in (RIGHT, LOOKED_AT)}
            print(f"{name:28} {len(own) - len(wrong)}/{len(own)} {wrong or ''}")
    for kind in (RIGHT, LOOKED_AT, MARKED, SILENT):
        print(f"{kind}: {every.count(kind)} of {len(every)}, {every.count(kind) / len(every):.0%}")


if __name__ == "__main__":
    main(*sys.argv[1:])
