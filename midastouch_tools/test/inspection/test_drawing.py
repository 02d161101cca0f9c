"""Pictures and exported files, by the real Open3D."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra
from midastouch_tools import cli
from midastouch_tools.inspection import require_open3d, window
from midastouch_tools.inspection.geometry import export, mesh_geometry, shapes
from midastouch_tools.inspection.pictures import Pictures, save

from .conftest import MOMENTS


def test_without_open3d_it_names_the_command_that_installs_it_once_the_input_is_right(
    run, mesh, tmp_path, monkeypatch, capsys
):
    monkeypatch.delitem(sys.modules, "midastouch_tools.inspection.library", raising=False)
    monkeypatch.setitem(sys.modules, "open3d", None)
    assert cli.main(["inspect", "no_run.mcap"]) == 2
    assert "no_run.mcap" in (said := capsys.readouterr().err)
    assert "Open3D" not in said
    monkeypatch.setattr("midastouch_tools.inspection.run.load", lambda *_: run)
    mesh.save(tmp_path / "box.ply")
    assert cli.main(["inspect", "run.mcap", "--mesh", str(tmp_path / "box.ply"), "--at", str(MOMENTS)]) == 2
    assert "--at" in capsys.readouterr().err
    assert cli.main(["inspect", "run.mcap", "--mesh", str(tmp_path / "box.ply")]) == 2
    assert install_extra("open3d") in capsys.readouterr().err


def test_a_missing_system_library_is_named(monkeypatch, tmp_path):
    """As the loader says it, by a module in the place of Open3D."""
    (tmp_path / "open3d.py").write_text("raise ImportError('libEGL.so.1: cannot open shared object file')")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("open3d", "midastouch_tools.inspection.library"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(InputError, match=r"libEGL.so.1.*libegl1"):
        require_open3d()


def test_pictures_show_mesh_and_layers(open3d, run, mesh):
    with Pictures(run, mesh) as pictures:
        first, last = pictures.draw(0), pictures.draw(MOMENTS - 1)
        again = pictures.draw(0)
    assert first.shape == (960, 1280, 3)
    np.testing.assert_array_equal(again, first)
    corners = first[-40:, :40]
    assert (corners == 255).all()
    grey = np.ptp(first[200:760, 300:980].astype(int), axis=2) < 30
    assert grey.mean() > 0.5  # the box fills the middle of the picture
    magenta = (last[..., 0] > 150) & (last[..., 1] < 90) & (last[..., 2] > 120)
    assert magenta.sum() > 50  # the contact, felt at the last moment only
    assert not ((first[..., 0] > 150) & (first[..., 1] < 90) & (first[..., 2] > 120)).any()


def test_a_picture_is_a_png(open3d, run, mesh, tmp_path):
    with pytest.raises(InputError, match=r"run.jpg: pictures are .png files"):
        save(run, mesh, {0: tmp_path / "run.jpg"})


@pytest.mark.parametrize("clouds", ["ply", "pcd"])
def test_exported_clouds_are_what_is_drawn(open3d, run, mesh, tmp_path, clouds):
    assert export(run, mesh, [0, 3], tmp_path, clouds) == 1 + 3 + 5
    read = open3d.io.read_triangle_mesh(str(tmp_path / "mesh.ply"))
    np.testing.assert_allclose(np.asarray(read.vertices), mesh.vertices, atol=1e-9)
    assert len(read.triangles) == len(mesh.faces)
    drawn = shapes(run.moments, 3)
    for name in ("particles", "contact"):
        cloud = open3d.io.read_point_cloud(str(tmp_path / "0003" / f"{name}.{clouds}"))
        np.testing.assert_allclose(np.asarray(cloud.points), drawn[name].points, atol=1e-7)
        np.testing.assert_allclose(np.asarray(cloud.colors), drawn[name].colours, atol=1 / 255)
    lines = open3d.io.read_line_set(str(tmp_path / "0003" / "modes.ply"))
    np.testing.assert_allclose(np.asarray(lines.points), drawn["modes"].points, atol=1e-7)
    np.testing.assert_array_equal(np.asarray(lines.lines), drawn["modes"].lines)


@pytest.fixture
def result(mesh, tmp_path) -> Path:
    """A result of evaluate with three frames, and its mesh."""
    trimesh.Trimesh(mesh.vertices, mesh.faces).export(tmp_path / "box.ply")
    poses = [[0.01 * i, 0, 0.02, 0, 0, 0, 1] for i in range(3)]
    trial = {"frame": [0, 1, 2], "estimate": poses, "state": ["converged"] * 3}
    content = {
        "sequences": [{"sequence": "box/00", "mesh": str(tmp_path / "box.ply"), "truth": poses}],
        "trials": [{"sequence": "box/00", "per_frame": trial}],
    }
    path = tmp_path / "result.json"
    path.write_text(json.dumps(content))
    return path


def test_the_command_draws_and_exports(open3d, result, tmp_path, capsys):
    folder, exported = tmp_path / "pictures", tmp_path / "exported"
    assert cli.main(["inspect", str(result), "--save", str(folder), "--export", str(exported)]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["0000.png", "0001.png", "0002.png"]
    assert sorted(path.name for path in exported.iterdir()) == ["0000", "0001", "0002", "mesh.ply"]
    assert sorted(path.name for path in (exported / "0002").iterdir()) == ["estimate.ply", "truth.ply"]
    assert f"{exported}: 7 files" in capsys.readouterr().out
    assert cli.main(["inspect", str(result), "--save", str(tmp_path / "one.png"), "--at", "-1"]) == 0
    assert (tmp_path / "one.png").read_bytes() == (folder / "0002.png").read_bytes()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--at", "3"], "has the moments 0 to 2"),
        (["--mesh", "no_such.ply"], "no_such.ply"),
        (["--sequence", "cup/00"], "give the --sequence to look at: box/00"),
        (["--save", "picture.bmp"], "pictures are .png files"),
    ],
)
def test_the_command_says_what_is_wrong(open3d, result, options, reason, capsys):
    assert cli.main(["inspect", str(result), *options]) == 2
    assert reason in capsys.readouterr().err


def test_a_mesh_has_the_normals_that_shading_needs(open3d, mesh):
    geometry = mesh_geometry(mesh)
    assert geometry.has_vertex_normals()
    assert geometry.has_triangle_normals()


def test_without_a_display_the_window_names_the_other_way(open3d, run, mesh, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="--save"):
        window.show(run, mesh, 0)
