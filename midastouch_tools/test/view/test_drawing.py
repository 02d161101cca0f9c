"""A finished run, drawn by the real Rerun and exported by the real Open3D."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra
from midastouch_tools import cli
from midastouch_tools.view import require_open3d
from midastouch_tools.view.clouds import export, shapes

from .conftest import evaluation


def test_bad_input_is_named_before_how_to_install_open3d(run, mesh, tmp_path, monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, "midastouch_tools.view.open3d_library", raising=False)
    monkeypatch.setitem(sys.modules, "open3d", None)
    to = ["--export", str(tmp_path / "exported")]
    assert cli.main(["view", "no_run.mcap", *to]) == 2
    assert "no_run.mcap" in (said := capsys.readouterr().err)
    assert "Open3D" not in said
    monkeypatch.setattr("midastouch_tools.view.finished_run.load", lambda *_: run)
    mesh.save(tmp_path / "box.ply")
    assert cli.main(["view", "run.mcap", "--mesh", str(tmp_path / "box.ply"), *to]) == 2
    assert install_extra("open3d") in capsys.readouterr().err
    assert not (tmp_path / "exported").exists()


def test_a_missing_system_library_is_named(monkeypatch, tmp_path):
    """As the loader says it, by a module in the place of Open3D."""
    (tmp_path / "open3d.py").write_text("raise ImportError('libEGL.so.1: cannot open shared object file')")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("open3d", "midastouch_tools.view.open3d_library"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(InputError, match=r"libEGL.so.1.*libegl1"):
        require_open3d()


def test_exported_clouds_are_the_layers_of_the_run(open3d, run, mesh, tmp_path):
    assert export(run, mesh, tmp_path) == 1 + 3 + 3 * 5
    read = open3d.io.read_triangle_mesh(str(tmp_path / "mesh.ply"))
    np.testing.assert_allclose(np.asarray(read.vertices), mesh.vertices, atol=1e-9)
    assert len(read.triangles) == len(mesh.faces)
    drawn = shapes(run.moments, 3)
    for name in ("particles", "contact"):
        cloud = open3d.io.read_point_cloud(str(tmp_path / "0003" / f"{name}.ply"))
        np.testing.assert_allclose(np.asarray(cloud.points), drawn[name].points, atol=1e-7)
        np.testing.assert_allclose(np.asarray(cloud.colors), drawn[name].colours, atol=1 / 255)
    lines = open3d.io.read_line_set(str(tmp_path / "0003" / "modes.ply"))
    np.testing.assert_allclose(np.asarray(lines.points), drawn["modes"].points, atol=1e-7)
    np.testing.assert_array_equal(np.asarray(lines.lines), drawn["modes"].lines)


@pytest.fixture
def result(mesh, tmp_path) -> Path:
    """A result of evaluate with three frames, and its mesh."""
    mesh.save(tmp_path / "box.ply")
    path = tmp_path / "result.json"
    path.write_text(json.dumps(evaluation("box/00", mesh=str(tmp_path / "box.ply"))))
    return path


def test_the_command_exports(open3d, result, tmp_path, capsys):
    exported = tmp_path / "exported"
    assert cli.main(["view", str(result), "--export", str(exported)]) == 0
    assert sorted(path.name for path in exported.iterdir()) == ["0000", "0001", "0002", "mesh.ply"]
    assert sorted(path.name for path in (exported / "0002").iterdir()) == ["estimate.ply", "truth.ply"]
    assert f"{exported}: 7 files" in capsys.readouterr().out


def test_the_command_draws_every_trial_on_a_timeline(result, tmp_path, capsys):
    rerun_cli = pytest.importorskip("rerun_cli", reason="the view extra (rerun-sdk) is not installed")
    out = tmp_path / "run.rrd"
    assert cli.main(["view", str(result), "--save", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}: once this has ended, open it with: rerun {out}\n"
    command = [Path(rerun_cli.__file__).parent / "rerun", "rrd", "print", "-vv", out]
    printed = subprocess.run(command, capture_output=True, text=True).stdout
    for entity in ("object/mesh", "object/truth/here", "object/estimate/here", "object/estimate_2/here"):
        assert entity in printed
    assert "moment" in printed


@pytest.mark.parametrize(
    ("options", "reason"),
    [(["--mesh", "no_such.ply"], "no_such.ply"), (["--sequence", "cup/00"], "give the --sequence to look at: box/00")],
)
def test_the_command_says_what_is_wrong(result, options, reason, capsys):
    assert cli.main(["view", str(result), *options]) == 2
    assert reason in capsys.readouterr().err


def test_an_export_needs_a_finished_run(tmp_path, capsys):
    assert cli.main(["view", "--export", str(tmp_path / "exported")]) == 2
    assert "name its bag" in capsys.readouterr().err
