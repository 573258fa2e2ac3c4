"""Settings files that are too large."""

from dataclasses import replace

import pytest

from soilml.errors import InputError
from soilml.io import toml_settings
from soilml.io.bounds import SETTINGS


def test_a_file_without_end_is_read_no_further_than_any_settings_reach(tmp_path, monkeypatch):
    monkeypatch.setattr(toml_settings, "SETTINGS", replace(SETTINGS, most=2_000_000))
    file = tmp_path / "m.toml"
    file.write_text("#" * 2_000_000)
    assert toml_settings.read_settings(file).content == {}
    file.write_text("#" * 2_000_001)
    with pytest.raises(InputError, match="has more than 2000000 characters; needed are"):
        toml_settings.read_settings(file)
