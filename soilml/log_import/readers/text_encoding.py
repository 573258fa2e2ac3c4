"""The text of a log file, whatever its encoding."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from soilml.errors import InputError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
#: Share of zero bytes at odd or even places from which text counts as UTF-16 without a mark.
_ZERO_SHARE = 0.3
#: Bytes above ASCII in a row, and the share of those in pairs or more that says Chinese.
_HIGH, _PAIRED = re.compile(rb"[\x80-\xff]+"), 0.8


def decode_text(data: bytes, file: Path) -> tuple[str, str]:
    """The text and its encoding: UTF-8, UTF-16 with or without a mark, GB 18030 or Windows-1252.

    Raises `InputError` for a file that is not text.
    """
    for mark, name in _MARKS:
        if data.startswith(mark):
            return data.decode(name, errors="replace"), name
    head = data[:4096]
    for first, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        part = head[first::2]
        if part and part.count(0) > _ZERO_SHARE * len(part):
            return data.decode(name, errors="replace"), name
    if b"\0" in head:
        raise InputError(
            f"{file} is not a text file, and its name has no ending of another format; known are "
            ".csv, .txt, .tsv, .dat, .json, .parquet, .mat, .h5, .mcap and .bag"
        )
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        pass
    # letters with accents stand alone among ASCII, Chinese characters are two bytes each
    runs = _HIGH.findall(data)
    if sum(len(run) for run in runs if len(run) >= 2) > _PAIRED * sum(map(len, runs)):
        try:
            return data.decode("gb18030"), "gb18030"
        except UnicodeDecodeError:
            pass
    return data.decode("cp1252", errors="replace"), "cp1252"
