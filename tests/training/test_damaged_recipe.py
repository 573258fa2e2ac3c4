"""The recipe in a file's metadata is what was written, or the file is refused."""

import hashlib
import json

import pyarrow.parquet as pq

from soilml.cli import main


def changed(small_data, folder, change, sign):
    data = pq.read_table(small_data)
    metadata = dict(data.schema.metadata)
    content = json.loads(metadata[b"soilml_recipe"])
    text = change(content)
    text = json.dumps(content, sort_keys=True) if text is None else text
    metadata[b"soilml_recipe"] = text.encode()
    if sign:
        digest = hashlib.sha256(text.encode()).hexdigest()
        metadata[b"soilml_recipe_sha256"] = digest.encode()
    pq.write_table(data.replace_schema_metadata(metadata), folder / "d.parquet")
    (folder / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    return ["train", str(folder / "spec.toml"), str(folder / "d.parquet"), str(folder / "o.onnx")]


def refused(words, capsys, said):
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and said in captured.err, captured.err


def test_a_recipe_that_was_changed(small_data, tmp_path, capsys):
    def doubled(content):
        content["gear"]["radius"] *= 2.0

    words = changed(small_data, tmp_path, doubled, sign=False)
    refused(words, capsys, "does not match its checksum")
