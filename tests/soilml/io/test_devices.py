"""Devices are refused wherever a file is read, before anything of them is."""

import os
import threading

import pytest

from soilml import read_table
from soilml.errors import InputError
from soilml.io.toml_settings import read_settings
from soilml.log_import.readers import read_log


@pytest.mark.parametrize("read", [read_settings, read_table, read_log])
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_refused_in_one_line(read, device):
    with pytest.raises(InputError) as caught:
        read(device)
    assert str(caught.value) == f"{device} cannot be read: it is a device; needed is a file"


def test_tables_and_settings_are_read_from_pipes(tmp_path):
    contents = {read_settings: "a = 1\n", read_table: "run,slip\na,0.1\n"}
    for read, text in contents.items():
        pipe = tmp_path / read.__name__
        os.mkfifo(pipe)
        writer = threading.Thread(target=pipe.write_text, args=(text,))
        writer.start()
        found = read(pipe)
        writer.join()
        assert getattr(found, "content", None) == {"a": 1} or found["slip"].tolist() == [0.1]
