"""Text of the page names no file of its owner, whatever settings it uses."""

import json

import pytest
from conftest import MODEL
from served_page import page as page
from served_page import runs_file

from soilml import Model, Wheel
from soilml.errors import InputError
from soilml.serve.forward import controls, forward

SECRET = "root:x:0:0:the first line of a file that is not the page's"
RANGES = "slip = [0.05, 0.6]\nload_N = [30, 110]\n"


@pytest.fixture(scope="module")
def secret(tmp_path_factory):
    file = tmp_path_factory.mktemp("owner") / "secret.csv"
    file.write_text(SECRET + "\n")
    return file


def text_of(name):
    return f'{MODEL}[simulator]\ntable = "{name}"\n{RANGES}'


def check(answer, secret):
    said = json.dumps(answer)
    assert "may name no file" in said, said
    assert SECRET[:12] not in said and "no such file" not in said


@pytest.mark.parametrize("ask", [controls, forward], ids=lambda ask: ask.__name__)
def test_no_answer_reads_a_file_that_a_model_names(ask, secret):
    for name in (secret, "/nowhere/at/all.csv", "../../secret.csv"):
        with pytest.raises(InputError, match="may name no file") as found:
            ask({"model": text_of(name), "values": {}})
        check(str(found.value), secret)


def test_no_job_reads_a_file_that_its_settings_name(page, secret, tmp_path):
    key = page.put("RUNS.csv", runs_file(tmp_path, Model(Wheel(radius=0.15, width=0.12)))
                   .read_bytes())  # fmt: skip
    for kind in ("identify", "gap", "pull"):
        job = page.job(kind=kind, files=[key], model=text_of(secret))
        assert job["state"] == "failed"
        check(job, secret)
