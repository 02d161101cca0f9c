import sys
from types import ModuleType

import pytest

from midastouch_common.errors import InputError
from midastouch_tools import cli
from midastouch_tools.bags.images import GelStream
from midastouch_tools.commands import arguments


def test_bundled_objects_are_meshes_by_name():
    assert arguments.load_mesh("handle_tool").name == "handle_tool"


def test_for_an_unknown_name_the_bundled_meshes_are_listed():
    with pytest.raises(InputError, match="handle_tool"):
        arguments.load_mesh("teapot")


@pytest.mark.parametrize(
    ("command", "reader"),
    [
        (["time-offset", "a.mcap"], "midastouch_tools.bags.images.read_bag"),
        (["export", "a.mcap", "--format", "hdf5", "--out", "o"], "midastouch_tools.export.recording.Recording"),
    ],
)
def test_whatever_reads_a_bag_takes_the_names_in_it(monkeypatch, capsys, command, reader):
    asked = {}

    def read(path, stream):
        asked[str(path)] = stream
        raise InputError("asked")

    monkeypatch.setitem(sys.modules, "h5py", ModuleType("h5py"))  # of an extra; nothing is written
    monkeypatch.setattr(reader, read)
    names = ["--image-topic", "/left/image_raw", "--base-frame", "part", "--gel-frame", "left_gel"]
    assert cli.main([*command, *names]) == 2
    assert "asked" in capsys.readouterr().err
    assert asked == {"a.mcap": GelStream("/left/image_raw", "part", "left_gel")}
