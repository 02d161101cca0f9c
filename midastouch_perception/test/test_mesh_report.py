"""Each thing that is wrong with a mesh is seen, with its own fix; a sound mesh is not complained of."""

import dataclasses
import itertools
import re

import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.mesh_report import MeshReport
from midastouch_perception.objects import bundled_objects


def report_of(*parts: trimesh.Trimesh) -> MeshReport:
    whole = trimesh.util.concatenate(parts)
    return MeshReport.of(ObjectMesh.from_arrays(whole.vertices, whole.faces, "part"))


def problems(report: MeshReport, sensor) -> list[str]:
    report.require_usable()
    return list(report.lines(sensor))[1:]


def ball(radius: float, inward: bool = False) -> trimesh.Trimesh:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    faces = sphere.faces[:, ::-1] if inward else sphere.faces
    return trimesh.Trimesh(sphere.vertices, faces, process=False)


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_a_sound_mesh_is_not_complained_of(name, sensor):
    report = MeshReport.of(ObjectMesh.load(bundled_objects()[name]))
    assert (report.shells, report.inner_shells, report.open_edges, report.branching_edges) == (1, 0, 0, 0)
    assert (report.inside_out, report.two_sided) == (0, 0)
    assert problems(report, sensor) == []


def test_corners_that_are_not_shared_as_in_an_stl_make_no_holes(sensor):
    sphere = ball(0.03)
    corners = np.arange(3 * len(sphere.faces)).reshape(-1, 3)
    soup = trimesh.Trimesh(sphere.triangles.reshape(-1, 3), corners, process=False)
    assert report_of(soup) == report_of(sphere)
    (line,) = report_of(soup).lines(sensor)
    assert line == "part: 60 x 60 x 60 mm, closed"


def test_a_cavity_is_measured_and_to_be_removed(sensor):
    report = report_of(ball(0.03), ball(0.02, inward=True))
    assert (report.shells, report.inner_shells) == (2, 1)
    assert report.hidden == pytest.approx(4 / 13, abs=0.01)
    (problem,) = problems(report, sensor)
    assert re.search("31% .* 1 of 2 shells .*remove", problem)


def half_inside_out() -> trimesh.Trimesh:
    sphere = ball(0.03)
    turned = sphere.triangles_center[:, 0] > 0.005
    sphere.faces[turned] = sphere.faces[turned][:, ::-1]
    return sphere


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ((ball(0.03), ball(0.029, inward=True), ball(0.028)), "lies inside the object, 2 of 3 shells.*remove"),
        ((half_inside_out(),), "41% of the surface is inside out; let your .*normals"),
        ((ball(0.03), ball(0.03, inward=True)), "inside out; remove doubled faces, then let"),
    ],
    ids=["mostly inside", "half inside out", "doubled"],
)
def test_an_unusable_mesh_is_refused_with_the_first_step(parts, said):
    with pytest.raises(InputError, match=f"part: .*{said}"):
        report_of(*parts).require_usable()


def test_a_wall_within_a_bottle_is_not_taken_for_wrong_normals(sensor):
    profile = [[0, 0], [0.03, 0], [0.03, 0.05], [0.03, 0.1], [0, 0.1]]
    bottle = trimesh.creation.revolve(profile, sections=64)
    ring = np.flatnonzero(np.abs(bottle.vertices[:, 2] - 0.05) < 1e-9)
    first, *others = ring[np.argsort(np.arctan2(*bottle.vertices[ring, :2].T))]
    wall = [[first, a, b] for a, b in itertools.pairwise(others)]
    report = report_of(trimesh.Trimesh(bottle.vertices, [*bottle.faces, *wall], process=False))
    assert (report.shells, report.branching_edges, report.inside_out) == (1, 64, 0)
    hidden, branching = problems(report, sensor)
    assert "of the surface lies inside the object:" in hidden
    assert "remove doubled faces and inner walls" in branching


def sheet() -> trimesh.Trimesh:
    corners = np.array([[0, 0, 0.05], [0.03, 0, 0.05], [0.03, 0.03, 0.05], [0, 0.03, 0.05]])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])


def open_ball() -> trimesh.Trimesh:
    sphere = ball(0.03)
    return trimesh.Trimesh(sphere.vertices, sphere.faces[sphere.triangles_center[:, 2] < 0.029], process=False)


@pytest.mark.parametrize(
    ("report", "said"),
    [
        (report_of(ball(0.03), sheet()), "a sheet without thickness"),
        (report_of(open_ball()), "open edges around holes"),
        (report_of(ball(0.004)), "smaller than the gel"),
        (report_of(ball(0.9)), "in centimetres it is 18 mm long, in inches it is 45.7 mm long: scale it by"),
        (dataclasses.replace(report_of(ball(0.03)), faces=5_000_000), "5000000 faces"),
    ],
    ids=["sheet", "hole", "small", "large", "fine"],
)
def test_each_problem_of_a_usable_mesh_is_told_alone(report, said, sensor):
    (problem,) = problems(report, sensor)
    assert said in problem
