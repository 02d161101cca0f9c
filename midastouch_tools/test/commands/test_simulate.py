"""What `midastouch simulate` checks before it begins."""

import pytest
import trimesh

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.mesh_report import MeshReport
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools import cli
from midastouch_tools.datasets import slide_simulation


def open_box() -> trimesh.Trimesh:
    box = trimesh.creation.box((0.09, 0.05, 0.03))
    return trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5])


def with_hole() -> trimesh.Trimesh:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    return trimesh.Trimesh(sphere.vertices, sphere.faces[5:])


@pytest.fixture
def simulated(monkeypatch) -> list:
    made: list = []
    monkeypatch.setattr(slide_simulation, "simulate_sequence", lambda *args, **_: made.append(args[-1].mkdir()) or 0)
    return made


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        (trimesh.creation.box((0.09, 0.05, 0.03)), "90 x 50 x 30 mm, closed"),
        (open_box(), "seen from behind"),
        (with_hole(), "open edges around holes"),
        (trimesh.creation.icosphere(radius=0.0015), "smaller than the gel"),
    ],
    ids=["sound", "open", "hole", "small"],
)
def test_a_simulation_says_of_its_mesh_what_a_codebook_does(tmp_path, capsys, simulated, mesh, said):
    path = tmp_path / "part.ply"
    mesh.export(path)
    assert cli.main(["simulate", str(path), "--out", str(tmp_path / "slide")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines == list(MeshReport.of(ObjectMesh.load(path)).lines(SensorModel.load("digit_tacto")))
    assert said in lines[-1]
    assert len(simulated) == 1


def test_an_unusable_mesh_is_not_simulated(tmp_path, capsys, simulated):
    path = tmp_path / "part.ply"
    hollow = [trimesh.creation.icosphere(radius=radius) for radius in (0.03, 0.029, 0.028)]
    hollow[1].invert()
    trimesh.util.concatenate(hollow).export(path)
    assert cli.main(["simulate", str(path), "--out", str(tmp_path / "slide")]) == 2
    assert "lies inside the object" in capsys.readouterr().err
    assert simulated == []


def test_a_slide_that_another_call_wrote_meanwhile_is_kept(tmp_path, capsys, monkeypatch):
    other = tmp_path / "slide" / "of another call"
    monkeypatch.setattr(
        slide_simulation, "simulate_sequence", lambda *args, **_: args[-1].mkdir() or other.mkdir(parents=True)
    )
    assert cli.main(["simulate", "ball", "--out", str(tmp_path / "slide")]) == 2
    assert "slide: exists already; name another folder" in capsys.readouterr().err
    assert list(tmp_path.rglob("*")) == [tmp_path / "slide", other]
