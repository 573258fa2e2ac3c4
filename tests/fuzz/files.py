"""What the fuzzed inputs are made of: valid files, and texts that once caused trouble."""

from __future__ import annotations

import io
import json

import onnx
import pyarrow as pa
import pyarrow.parquet as pq
from conftest import RECIPE, THREE_CHANNEL_MODEL
from hypothesis import strategies as st

from soilml.onboard.model_file import metadata_checksum, serialise_metadata

TABLE = """\
run,slip,load_N,torque_Nm,drawbar_pull_N,sinkage_m
a,0.1,40,1.1,2.0,0.011
a,0.3,40,2.2,4.0,0.012
a,0.5,40,2.6,4.5,0.013
b,0.1,90,2.2,3.0,0.02
b,0.3,90,4.4,7.0,0.021
b,0.5,90,5.3,8.0,0.022
"""
MODEL = THREE_CHANNEL_MODEL
#: Another program in place of the equations, by a file that the page may not name.
SIMULATOR = """\
[simulator]
table = "/etc/hostname"
slip = [0.05, 0.6]
load_N = [30.0, 110.0]
"""
RECIPE_TEXT = RECIPE.format(rows=50, seed=1)

#: Forty lines of a rig that starts, drives with slip and stops, under a header with units.
LOG = "Rig 4\nt [s],v [m/s],omega [rad/s],T [Nm],Fz [N],Fx [N],z [mm]\n" + "".join(
    f"{0.1 * i:.1f},{v:.3f},{0.8 * (i > 8):.2f},{1.5 * (i > 8) + 0.01 * (i % 3):.3f},"
    f"{60 + i % 2},{4 * (i > 8)},{9 + i % 2}\n"
    for i in range(40)
    for v in (0.1 * (i > 8) + 0.001 * (i % 2),)
)

#: Cells, values and words that are written into valid files at random places.
TOKENS = [
    *("", " ", "0", "-0", "1", "-1", "0.999999", "1e-300", "1e300", "1e308", "-1e308", "1e999"),
    *("nan", "inf", "1_000", "0x10", "\uff11", "1,5", "=1+1", "'", '"', "[", "]", "{}", "[]"),
    *("[1, 2]", "[2, 1]", '"2 %"', '"1e300 %"', '"-1 %"', "true", "9" * 400, "a" * 300, "\x1b[2J"),
    *("\0", "\r", "\n", "#", "[[effect]]", "[gears.a]", '"wheel"', '"track"', "--", "-", "..", "/"),
    *("run", "slip", "load_N", "torque_Nm", "sinkage_m", "status", "gear", "pass", "speed_m_s"),
]  # fmt: skip
tokens = st.sampled_from(TOKENS) | st.text(max_size=8) | st.floats().map(repr)


@st.composite
def changed_text(draw: st.DrawFn, text: str) -> bytes:
    """A valid text in which some pieces between separators are replaced, repeated or left out."""
    separators = ",\n =[]"
    pieces, piece = [], ""
    for character in text:
        if character in separators:
            pieces += [piece, character]
            piece = ""
        else:
            piece += character
    for _ in range(draw(st.integers(0, 4))):
        place = draw(st.integers(0, len(pieces) - 1))
        change = draw(st.sampled_from(["replace", "repeat", "drop"]))
        if change == "replace":
            pieces[place] = draw(tokens)
        elif change == "repeat":
            pieces[place] *= draw(st.sampled_from([2, 3, 200]))
        else:
            pieces[place] = ""
    return "".join(pieces).encode("utf-8", "surrogatepass")


@st.composite
def changed_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    """Valid content with some bytes changed, cut off or doubled."""
    changed = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(len(changed) - 1, 0)))
        kind = draw(st.sampled_from(["byte", "cut", "insert"]))
        if kind == "byte" and changed:
            changed[place] = draw(st.integers(0, 255))
        elif kind == "cut":
            del changed[place : place + draw(st.integers(1, 64))]
        else:
            changed[place:place] = draw(st.binary(min_size=1, max_size=16))
    return bytes(changed)


@st.composite
def changed_json(draw: st.DrawFn, value: object) -> object:
    """A JSON value in which one part, however deep, is another value."""
    if isinstance(value, dict | list) and value and draw(st.integers(0, 4)):
        keys = sorted(value) if isinstance(value, dict) else range(len(value))
        key = draw(st.sampled_from(list(keys)))
        copy = value.copy()
        copy[key] = draw(changed_json(value[key]))  # type: ignore[index]
        return copy
    numbers = st.sampled_from([0, -1, 0.5, 1e308, 10**30, 2**63])
    others = st.sampled_from([None, True, "", "x", "2 %", [], [1], {}, {"a": 1}, "[" * 50])
    return draw(numbers | others)


def parquet_bytes(columns: dict[str, list[object]], metadata: dict[str, str]) -> bytes:
    """A Parquet file in memory."""
    out = io.BytesIO()
    pq.write_table(pa.table(columns).replace_schema_metadata(metadata), out)
    return out.getvalue()


def signed_model(content: bytes, key: str, value: object) -> bytes:
    """A model file with one entry of its metadata replaced and the checksum of all made anew."""
    model = onnx.load_from_string(content)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    metadata[key] = value if isinstance(value, str) else json.dumps(value)
    metadata["metadata_sha256"] = metadata_checksum(metadata)
    del model.metadata_props[:]
    return model.SerializeToString(deterministic=True) + serialise_metadata(metadata)
