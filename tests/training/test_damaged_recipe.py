"""The recipe in a file's metadata is what was written, or the file is refused."""

import json

import pyarrow.parquet as pq

from soilml.cli import main


def test_a_recipe_that_was_changed(small_data, tmp_path, capsys):
    data = pq.read_table(small_data)
    recipe = json.loads(data.schema.metadata[b"soilml_recipe"])
    recipe["gear"]["radius"] *= 2.0
    changed = {**data.schema.metadata, b"soilml_recipe": json.dumps(recipe, sort_keys=True)}
    pq.write_table(data.replace_schema_metadata(changed), tmp_path / "d.parquet")
    assert main(["train", "linear", str(tmp_path / "d.parquet"), str(tmp_path / "o.onnx")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "does not match its checksum" in said
