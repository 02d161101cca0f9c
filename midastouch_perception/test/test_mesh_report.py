"""Each thing that is wrong with a mesh is seen, with its own fix; a sound mesh is not complained of."""

import dataclasses
import itertools

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
    assert "31% of the surface lies inside the object, 1 of 2 shells wholly" in problem
    assert "remove walls of cavities" in problem


def test_a_mesh_that_is_mostly_inside_is_refused():
    with pytest.raises(InputError, match=r"part: .*lies inside the object, 2 of 3 shells.*remove"):
        report_of(ball(0.03), ball(0.029, inward=True), ball(0.028)).require_usable()


def test_a_surface_half_inside_out_is_refused():
    sphere = ball(0.03)
    turned = sphere.triangles_center[:, 0] > 0.005
    faces = np.where(turned[:, None], sphere.faces[:, ::-1], sphere.faces)
    with pytest.raises(InputError, match=r"part: 41% of the surface is inside out; let your .*recalculate the normals"):
        report_of(trimesh.Trimesh(sphere.vertices, faces, process=False)).require_usable()


def test_it_says_to_remove_doubled_faces_before_fixing_normals():
    with pytest.raises(InputError, match="inside out; remove doubled faces, then let"):
        report_of(ball(0.03), ball(0.03, inward=True)).require_usable()


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


def test_a_stray_sheet_and_a_hole_are_different(sensor):
    corners = np.array([[0, 0, 0.05], [0.03, 0, 0.05], [0.03, 0.03, 0.05], [0, 0.03, 0.05]])
    (problem,) = problems(report_of(ball(0.03), trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])), sensor)
    assert "it is a sheet without thickness" in problem
    sphere = ball(0.03)
    kept = sphere.faces[sphere.triangles_center[:, 2] < 0.029]
    (problem,) = problems(report_of(trimesh.Trimesh(sphere.vertices, kept, process=False)), sensor)
    assert "open edges around holes" in problem


def test_what_is_smaller_than_the_gel_or_far_too_fine_is_said(sensor):
    (problem,) = problems(report_of(ball(0.004)), sensor)
    assert "smaller than the gel" in problem
    (problem,) = problems(dataclasses.replace(report_of(ball(0.03)), faces=5_000_000), sensor)
    assert "5000000 faces" in problem
