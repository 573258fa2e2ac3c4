"""Small files that ask for much memory or time, and a command that reads them in a process."""

from __future__ import annotations

import io
import os
import re
import resource
import struct
import subprocess
import sys
import zipfile
import zlib

import numpy as np

#: Address space of a command, bytes: a reader without bounds ends here, and not the machine.
LIMIT = 8 << 30


def run(words, folder, seconds=60):
    """Status, standard error and peak memory (bytes) of a command in a process of its own."""
    own = (
        "import re, sys; from soilml.cli import main; status = main(sys.argv[1:]);"
        "text = open('/proc/self/status').read();"
        "sys.stdout.write(re.search(r'VmHWM:\\s*(\\d+)', text)[1]); sys.exit(status)"
    )
    limits = {resource.RLIMIT_AS: LIMIT, resource.RLIMIT_CPU: seconds}
    done = subprocess.run(
        [sys.executable, "-c", own, *map(str, words)],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        preexec_fn=lambda: [resource.setrlimit(k, (v, v)) for k, v in limits.items()],
    )
    peak = re.search(r"(\d+)$", done.stdout)
    return done.returncode, done.stderr, 1024 * int(peak[1]) if peak else LIMIT


# MATLAB files of version 5 ("MAT-File Format", The MathWorks): elements of a tag and its content
_MATRIX, _COMPRESSED, _INT8, _INT32, _UINT32, _DOUBLE, _UINT8 = 14, 15, 1, 5, 6, 9, 2
_CELL, _STRUCT, _BYTES = 1, 2, 9


def _element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def _matrix(kind, shape, name, content):
    return _element(
        _MATRIX,
        _element(_UINT32, struct.pack("<II", kind, 0))
        + _element(_INT32, np.asarray(shape, "<i4").tobytes())
        + _element(_INT8, name.encode())
        + content,
    )


def _mat(*elements):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    packed = (zlib.compress(element, 9) for element in elements)
    return head + b"".join(struct.pack("<II", _COMPRESSED, len(p)) + p for p in packed)


def packed_mat():
    """An array of 45 million bytes of zero, 44 kB."""
    count = 45_000_000
    return _mat(_matrix(_BYTES, (count, 1), "force", _element(_UINT8, bytes(count))))


def cells_mat():
    """A cell array of single numbers."""
    count = 1_500_000
    one = _matrix(6, (1, 1), "", _element(_DOUBLE, bytes(8)))
    return _mat(_matrix(_CELL, (count, 1), "force", one * count))


def claimed_mat():
    """A cell array that claims two thousand million cells and has none."""
    return _mat(_matrix(_CELL, (2_000_000_000, 1), "force", b""))


def nested_mat():
    """A cell in a cell, and so on."""
    content = _matrix(6, (1, 1), "", _element(_DOUBLE, bytes(8)))
    for _ in range(3_000):
        content = _matrix(_CELL, (1, 1), "", content)
    return _mat(_matrix(_CELL, (1, 1), "force", content))


def far_cell_xlsx(place="XFD1048576", cells=""):
    """A sheet with a cell at its far end."""
    row = place.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
    sheet = (
        f'<worksheet xmlns="{_MAIN}"><sheetData>'
        '<row r="1"><c r="A1" t="inlineStr"><is><t>slip</t></is></c></row>'
        f'{cells}<row r="{row}"><c r="{place}"><v>1</v></c></row></sheetData></worksheet>'
    )
    return _xlsx(sheet)


def small_xlsx():
    """A sheet of numbers below their names."""
    rows = "".join(
        f'<row r="{i}"><c r="A{i}"><v>0.{i}</v></c><c r="B{i}"><v>60</v></c></row>'
        for i in range(2, 12)
    )
    names = "".join(
        f'<c r="{letter}1" t="inlineStr"><is><t>{name}</t></is></c>'
        for letter, name in {"A": "slip", "B": "load_N"}.items()
    )
    return _xlsx(
        f'<worksheet xmlns="{_MAIN}"><sheetData><row r="1">{names}</row>{rows}</sheetData>'
        "</worksheet>"
    )


def small_mat():
    """Two arrays of ten numbers, in a struct and beside it."""
    numbers = np.linspace(0.1, 1.0, 10)
    own = _matrix(6, (10, 1), "", _element(_DOUBLE, numbers.tobytes()))
    names = _element(_INT32, struct.pack("<i", 8)) + _element(_INT8, b"torque".ljust(8, b"\0"))
    return _mat(
        _matrix(6, (10, 1), "time", _element(_DOUBLE, numbers.tobytes())),
        _matrix(_STRUCT, (1, 1), "log", names + own),
    )


def small_hdf5():
    """A data set of ten numbers in a group, packed."""
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w", track_order=True) as file:
        file.create_dataset("log/torque", data=np.linspace(0.1, 1.0, 10), compression="gzip")
    return content.getvalue()


def implied_cells_xlsx():
    """Rows and cells without their places, and one far to the right."""
    sheet = (
        f'<worksheet xmlns="{_MAIN}"><sheetData>'
        + "<row><c><v>1</v></c></row>" * 200_000
        + '<row><c r="XFD200001"><v>1</v></c></row></sheetData></worksheet>'
    )
    return _xlsx(sheet)


def long_text_xlsx():
    """One text of 32,000 characters, in 400,000 cells."""
    head = (
        '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
    )
    row = "<row>" + '<c t="s"><v>0</v></c>' * 4 + "</row>"
    shared = f'<sst xmlns="{_MAIN}"><si><t>{"a" * 32_000}</t></si></sst>'
    return _xlsx(f"{head}{row * 100_000}</sheetData></worksheet>", shared)


_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"


def _xlsx(sheet, shared=""):
    """A workbook of one sheet; ECMA-376, part 1."""
    parts = {"workbook": "sheet.main", "worksheets/sheet1": "worksheet"}
    parts |= {"sharedStrings": "sharedStrings"} if shared else {}
    types = "".join(
        f'<Override PartName="/xl/{name}.xml" ContentType="{_KIND}.{kind}+xml"/>'
        for name, kind in parts.items()
    )
    inner = "".join(
        f'<Relationship Id="r{i}" Type="{_RELATIONS}/{kind}" Target="{name}.xml"/>'
        for i, (name, kind) in enumerate([*parts.items()][1:])
    )
    content = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f"{types}</Types>",
        "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="r0" '
        f'Type="{_RELATIONS}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}/relationships">{inner}'
        "</Relationships>",
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_RELATIONS}"><sheets><sheet '
        'name="A" sheetId="1" r:id="r0"/></sheets></workbook>',
        "xl/worksheets/sheet1.xml": sheet,
    } | ({"xl/sharedStrings.xml": shared} if shared else {})
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        for name, text in content.items():
            file.writestr(name, text)
    return packed.getvalue()


def _parquet(columns, **options):
    import pyarrow as pa
    import pyarrow.parquet as pq

    content = io.BytesIO()
    pq.write_table(pa.table(columns), content, compression="zstd", **options)
    return content.getvalue()


def _constant(rows, **columns):
    """Rows of equal values, whose texts are stored once."""
    import pyarrow as pa

    return {
        name: pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), pa.array([value]))
        if isinstance(value, str)
        else pa.array(np.full(rows, value))
        for name, value in columns.items()
    }


def long_names_parquet():
    """Two million equal names of 250 characters."""
    rows = 2_000_000
    return _parquet(_constant(rows, run="a" * 250, slip=0.2, load_N=60.0, torque_Nm=2.0))


def constant_parquet():
    """More equal rows than are estimated."""
    return _parquet(_constant(2_100_000, run="a", slip=0.2, load_N=60.0, torque_Nm=2.0))


def large_dictionary_parquet():
    """Names of 1 kB, six hundred thousand of them, which compress to nothing."""
    import pyarrow as pa

    count = 600_000
    names = pa.array([f"{i:07d}" + "a" * 1017 for i in range(count)])
    rows = _constant(count, slip=0.2, load_N=60.0, torque_Nm=2.0)
    return _parquet({"run": names, **rows}, dictionary_pagesize_limit=1 << 31, use_dictionary=True)


def many_columns_csv(count):
    """A header of many columns, and a few rows."""
    names = ",".join(f"c{i}" for i in range(count))
    return "\n".join([names, *[",".join(["1"] * count)] * 3]).encode()


def unallocated_hdf5():
    """A data set of 2e11 numbers, of which none is stored."""
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file.create_dataset("force", (200_000_000_000,), "f8", chunks=(1 << 16,))
    return content.getvalue()


def widening_json():
    """Lines of which each has a key of its own."""
    return "\n".join(f'{{"k{i}": 1, "t": {i}}}' for i in range(60_000)).encode()


def claimed_chunk_mcap():
    """A chunk of MCAP that states a size of 3 TB."""
    from zstandard import ZstdCompressor

    body = ZstdCompressor().compress(bytes(1 << 20))
    chunk = struct.pack("<QQQI", 0, 0, 3 << 40, 0) + struct.pack("<I", 4) + b"zstd"
    chunk += struct.pack("<Q", len(body)) + body
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk


def claimed_chunk_bag():
    """A chunk of a bag of ROS 1 that states a size of 4 GB."""
    fields = (b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", 0xFFFFFFF0))
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    record = struct.pack("<I", len(header)) + header + struct.pack("<I", 4) + bytes(4)
    return b"#ROSBAG V2.0\n" + record
