"""The recipe in a file's metadata is what was written, or the file is refused."""

import hashlib
import json

import pyarrow.parquet as pq
import pytest

from soilml.cli import main


def prior(value):
    return lambda content: content["soil"].update(prior=value)


def cohesion(value):
    return lambda content: content["soil"]["prior"].update(cohesion=value)


def put(key, value):
    return lambda content: content.update({key: value})


KINDS = {
    "no JSON": lambda content: "{",
    "nothing": lambda content: "",
    "a list": lambda content: "[]",
    "null": lambda content: "null",
    "nested": lambda content: "[" * 5000,
    "soil": put("soil", [1]),
    "prior": prior("wide"),
    "prior upside down": cohesion([3000.0, 0.0]),
    "prior without numbers": cohesion(["a", None]),
    "prior without range": cohesion({"range": None}),
    "gear": put("gear", 3),
    "radius": lambda content: content["gear"].update(radius=-0.3),
    "noise": put("noise", 4),
    "operating": put("operating", None),
    "effect": put("effect", "grousers"),
    "effect without a name": put("effect", [{"nam": "grousers"}]),
    "effect with a list as name": put("effect", [{"name": ["a"]}]),
    "effect with a number as name": put("effect", [{"name": 5}]),
    "effect with escapes in its name": put("effect", [{"name": "x\n\x1b]0;y\x07"}]),
    "effect of the catalogue": put("effect", [{"name": "grousers", "height": "tall"}]),
}


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


@pytest.mark.parametrize("kind", KINDS)
def test_a_recipe_that_is_none(small_data, tmp_path, capsys, kind):
    words = changed(small_data, tmp_path, KINDS[kind], sign=True)
    refused(words, capsys, "recipe")
    assert not (tmp_path / "o.onnx").exists()


def test_a_recipe_that_was_changed(small_data, tmp_path, capsys):
    def doubled(content):
        content["gear"]["radius"] *= 2.0

    words = changed(small_data, tmp_path, doubled, sign=False)
    refused(words, capsys, "does not match its checksum")
