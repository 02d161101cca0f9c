"""Where an import finds no module, one line says how to install it."""

import sys

import pytest

from midastouch_common import missing_modules
from midastouch_common.executables import executable
from midastouch_common.missing_modules import how_to_install


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("igl", f"there is no module igl; install it: {sys.executable} -m pip install libigl"),
        ("sensor_msgs", "this needs ROS 2, and there is no module sensor_msgs; source a ROS 2"),
        ("midastouch_filter.nodes", "this needs ROS 2, and there is no module midastouch_filter.nodes; source a ROS 2"),
        ("anything", "No module named 'anything'; run midastouch doctor"),
    ],
)
def test_a_missing_module_is_named_with_what_brings_it(name, line):
    assert how_to_install(ModuleNotFoundError(f"No module named '{name}'", name=name)).startswith(line)


def test_without_a_clone_an_extra_is_its_distributions(monkeypatch, tmp_path):
    monkeypatch.setattr(missing_modules, "CLONE", tmp_path)
    assert missing_modules.install_extra("export") == f"{sys.executable} -m pip install h5py pyarrow"


def test_a_node_without_a_library_ends_as_of_bad_input(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "pykdtree", None)  # as if it were not installed
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "some_node.py").write_text("import pykdtree\n")
    assert executable("some_node")() == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        line == f"some_node: error: there is no module pykdtree; install it: {sys.executable} -m pip install pykdtree"
    )
