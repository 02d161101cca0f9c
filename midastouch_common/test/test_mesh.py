import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import FEWEST_THREADED_QUERIES, NearestPoints, ObjectMesh
from midastouch_common.mesh_units import unit_advice


def brute_force_distance(mesh, points):
    """Distances by trimesh's own triangle projection, every point against every triangle.

    In millimetres: trimesh's absolute tolerances are made for larger numbers than a scan's in metres.
    """
    triangles = mesh.vertices[mesh.faces] * 1e3
    out = []
    for point in points * 1e3:
        closest = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
        out.append(np.linalg.norm(closest - point, axis=1).min())
    return np.array(out) / 1e3


def test_closest_points_are_exact(block):
    rng = np.random.default_rng(0)
    points = np.concatenate(
        [rng.uniform(-0.03, 0.03, (40, 3)), block.sample_surface(20, rng)[0], rng.uniform(-0.5, 0.5, (10, 3))]
    )
    closest, distance, face = block.closest_points(points)
    np.testing.assert_allclose(distance, brute_force_distance(block, points), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distance, atol=1e-12)
    corners = block.vertices[block.faces[face]]
    offset = ((closest - corners[:, 0]) * block.face_normals[face]).sum(axis=1)
    np.testing.assert_allclose(offset, 0, atol=1e-9)


def test_closest_points_one_by_one_are_the_same(block):
    points = np.random.default_rng(4).uniform(-0.03, 0.03, (40, 3))
    together = block.closest_points(points)
    for i in range(40):
        for alone, all_at_once in zip(block.closest_points(points[i : i + 1]), together, strict=True):
            np.testing.assert_array_equal(alone[0], all_at_once[i])


def test_closest_points_of_nothing(block):
    closest, distance, face = block.closest_points(np.empty((0, 3)))
    assert closest.shape == (0, 3)
    assert len(distance) == len(face) == 0


def test_closest_points_of_points_that_are_not_numbers(block):
    points = np.array([[np.nan, 0, 0], [0, 0, 0.05], [0, np.inf, 0]])
    closest, distance, face = block.closest_points(points)
    np.testing.assert_array_equal(np.isfinite(distance), [False, True, False])
    assert np.isfinite(closest[1]).all()
    assert block.face_normals[face].shape == (3, 3)


def test_closest_points_of_more_than_are_asked_at_once(block):
    points = np.random.default_rng(5).uniform(-0.05, 0.05, (5000, 3))
    closest, distance, face = block.closest_points(points)
    for part in (slice(0, 100), slice(1990, 2010), slice(4900, 5000)):
        again = block.closest_points(points[part])
        for one, other in zip((closest[part], distance[part], face[part]), again, strict=True):
            np.testing.assert_array_equal(one, other)


def test_surface_samples_are_uniform_by_area():
    """A box's sides get samples in proportion to their areas."""
    box = trimesh.creation.box((0.1, 0.02, 0.04))
    mesh = ObjectMesh.from_arrays(box.vertices, box.faces, "box")
    points, normals, _ = mesh.sample_surface(20_000, np.random.default_rng(1))
    fraction = (np.abs(normals[:, 1]) > 0.5).mean()
    assert fraction == pytest.approx(0.1 * 0.04 / (0.1 * 0.04 + 0.1 * 0.02 + 0.02 * 0.04), abs=2e-3)
    top = points[normals[:, 1] > 0.5]
    np.testing.assert_allclose(top[:, 1], 0.01)
    np.testing.assert_allclose(top[:, [0, 2]].std(axis=0), [0.1 / 12**0.5, 0.04 / 12**0.5], rtol=0.05)


def test_inverted_mesh_is_turned_outward(block):
    inverted = ObjectMesh.from_arrays(block.vertices, block.faces[:, ::-1], "inverted")
    points, normals, _ = inverted.sample_surface(500, np.random.default_rng(0))
    assert (np.einsum("nj,nj->n", points, normals) > 0).all()
    np.testing.assert_allclose(np.abs(inverted.vertex_normals), np.abs(block.vertex_normals), atol=1e-12)


def test_feature_edges_of_a_box():
    """12 edges of a box, not the diagonals of its sides; split vertices do not matter."""
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    soup = box.vertices[box.faces].reshape(-1, 3)
    mesh = ObjectMesh.from_arrays(soup, np.arange(36).reshape(-1, 3), "soup")
    ends, normals = mesh.feature_edges
    assert len(ends) == 12
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 0.02)
    np.testing.assert_allclose(np.sort(np.abs(normals), axis=1), np.tile([0, 0.5**0.5, 0.5**0.5], (12, 1)), atol=1e-9)


def test_corner_normals_are_smooth_on_a_ball_and_sharp_on_a_box():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    split = ObjectMesh.from_arrays(ball.triangles.reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3), "ball")
    for mesh in (ObjectMesh.from_arrays(ball.vertices, ball.faces, "ball"), split):  # an STL has no shared vertices
        outward = mesh.vertices[mesh.faces] / 0.03
        assert (mesh.corner_normals * outward).sum(axis=-1).min() > 0.995
    box = trimesh.creation.box((0.1, 0.05, 0.02))
    mesh = ObjectMesh.from_arrays(box.vertices, box.faces, "box")
    assert mesh.corner_normals == pytest.approx(mesh.face_normals[:, None].repeat(3, axis=1))


def test_smooth_normals_turn_gradually_over_an_edge():
    box = trimesh.creation.box((0.06, 0.06, 0.06))
    mesh = ObjectMesh.from_arrays(box.vertices, box.faces, "box")
    x = np.linspace(0, 0.03, 20)
    normals = mesh.smooth_normals(np.stack([x, np.zeros(20), np.full(20, 0.03)], axis=1))
    assert normals[0, 2] > 0.999
    assert normals[-1, 2] == pytest.approx(0.5**0.5, abs=0.1)
    steps = np.arccos(np.clip((normals[1:] * normals[:-1]).sum(axis=1), -1, 1))
    assert np.degrees(steps.max()) < 20


def test_smooth_normals_do_not_cross_a_thin_plate():
    plate = trimesh.creation.box((0.06, 0.06, 0.001))
    mesh = ObjectMesh.from_arrays(plate.vertices, plate.faces, "plate")
    normals = mesh.smooth_normals(np.array([[0, 0, 0.0005], [0.01, 0, -0.0005]]))
    np.testing.assert_allclose(normals[:, 2], [1, -1], atol=1e-6)


def test_load_reads_what_was_written(tmp_path, block):
    path = tmp_path / "block.ply"
    trimesh.Trimesh(block.vertices, block.faces, process=False).export(path)
    mesh = ObjectMesh.load(path)
    assert mesh.name == "block"
    assert mesh.area == pytest.approx(block.area, rel=1e-4)
    assert mesh.path == path.resolve()


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply"])
def test_text_in_another_encoding_does_not_matter(tmp_path, suffix, monkeypatch):
    monkeypatch.setitem(sys.modules, "charset_normalizer", None)  # which guesses encodings, where it is installed
    box, path = trimesh.creation.box((0.05, 0.05, 0.05)), tmp_path / f"part.{suffix}"
    text = box.export(file_type="stl_ascii" if suffix == "stl" else suffix)
    head = {"obj": b"", "stl": b"solid", "ply": b"end_header"}[suffix]
    said = {"obj": b"# Geh\xe4use\n", "stl": b"solid Geh\xe4use", "ply": b"comment Geh\xe4use\nend_header"}[suffix]
    path.write_bytes((text if isinstance(text, bytes) else text.encode()).replace(head, said, 1))
    assert ObjectMesh.load(path).area == pytest.approx(box.area, rel=1e-5)


def bad_meshes(folder):
    (folder / "text.ply").write_text("not a mesh")
    (folder / "empty.stl").write_bytes(b"")
    (folder / "cut.stl").write_bytes(trimesh.creation.box((0.1, 0.05, 0.02)).export(file_type="stl")[:-30])
    trimesh.PointCloud(np.random.default_rng(0).random((10, 3))).export(folder / "points.ply")
    trimesh.creation.box((100, 50, 20)).export(folder / "millimetres.stl")
    trimesh.creation.box((1e-4, 5e-5, 2e-5)).export(folder / "dust.stl")
    (folder / "part.STEP").write_text("ISO-10303-21;")
    flat = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False)
    flat.export(folder / "flat.ply")


BOX = trimesh.creation.box((0.09, 0.05, 0.03))


def obj(box: trimesh.Trimesh, corners: Callable[[int, int], str]) -> str:
    """An OBJ of the box, each face below its own vertices; corners(1 to 3, number of vertices so far): of a face."""
    lines, written = ["# by hand", "vn 0 0 1"], 0
    for face in box.faces:
        for vertex in box.vertices[face]:
            lines.append("v {} {} {}".format(*vertex))
        written += 3
        lines.append("f " + " ".join(corners(i, written) for i in (1, 2, 3)))
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("size", "units", "factor"),
    [
        ((100, 50, 20), "in millimetres it is 100 mm long: scale it by 0.001", 0.001),
        (
            (7.06, 2.4, 1.6),
            "in centimetres it is 70.6 mm long, in inches it is 179 mm long: scale it by 0.01 or 0.0254",
            0.01,
        ),
        ((15, 12, 11), "in millimetres .*in centimetres .*in inches .*0.001 or 0.01 or 0.0254", 0.001),
    ],
)
def test_each_unit_that_would_fit_is_named_with_a_command_that_can_be_pasted(tmp_path, size, units, factor):
    path = tmp_path / "the 'part'.obj"
    path.write_text(obj(trimesh.creation.box(size), lambda i, _: f"{i - 4}"))
    with pytest.raises(InputError, match=f"{size[0]} m across; {units}; ") as refused:
        ObjectMesh.load(path)
    assert len(str(refused.value).splitlines()) == 1
    subprocess.run(str(refused.value).split("; ", 2)[2], shell=True, check=True)
    mesh = ObjectMesh.load(tmp_path / "the 'part'_metres.ply")
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), factor * np.array(size), rtol=1e-6)


def test_a_size_that_fits_no_unit_gets_no_command():
    assert unit_advice(1e6) == "no common unit makes it 10 to 500 mm long; export it in metres"


@pytest.mark.parametrize(
    "corners",
    [
        lambda i, written: f"{i - 4}",
        lambda i, written: f"{i - 4}//-1",
        lambda i, written: f"{written - 3 + i if i == 2 else i - 4}",
        lambda i, written: f"{written - 3 + i}",
        lambda i, written: f"{i - 4}" + (" # gr\u00fcn" if i == 3 else " \\\n"),
    ],
    ids=["relative", "with normals", "mixed", "absolute", "with comments on two lines"],
)
def test_faces_between_the_vertices_are_read_as_they_count(tmp_path, corners):
    (tmp_path / "box.obj").write_text(obj(BOX, corners), encoding="latin-1")
    mesh = ObjectMesh.load(tmp_path / "box.obj")
    assert (len(mesh.faces), len(mesh.vertices)) == (12, 36)
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), [0.09, 0.05, 0.03])
    assert mesh.area == pytest.approx(BOX.area)


@pytest.mark.parametrize("suffix", [".ply", ".off"])
def test_lines_that_are_missing_from_a_text_are_noticed(tmp_path, block, suffix):
    path = tmp_path / f"block{suffix}"
    options = {"encoding": "ascii"} if suffix == ".ply" else {}
    trimesh.Trimesh(block.vertices, block.faces, process=False).export(path, **options)
    whole = path.read_text().splitlines()
    path.write_text("\n".join(whole) + "\n\n")
    assert len(ObjectMesh.load(path).faces) == len(block.faces)
    path.write_text("\n".join(whole[:-1]))
    with pytest.raises(InputError, match=rf"block\{suffix}: has \d+ lines of vertices and faces, not \d+; export"):
        ObjectMesh.load(path)


@pytest.mark.parametrize("face", ["f 0 1 2", "f -4 -2 -1", "f 1 2 0/1"])
def test_vertices_that_are_not_there_yet_are_refused(tmp_path, face):
    (tmp_path / "box.obj").write_text(f"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n{face}\nv 0 0 0.1\n")
    with pytest.raises(InputError, match=r"box\.obj: a face names vertex (0|-4) after 3 vertices; export it again"):
        ObjectMesh.load(tmp_path / "box.obj")


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("thickness", [0, 5e-5, 2e-4])
def test_an_object_without_thickness_is_refused(tmp_path, thickness, turned):
    box = trimesh.creation.box((0.1, 0.05, 1))
    box.vertices[:, 2] *= thickness
    if turned:
        box.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    box.export(tmp_path / "plate.ply")
    if thickness > 1e-4:
        assert ObjectMesh.load(tmp_path / "plate.ply").thickness == pytest.approx(thickness, rel=1e-3)
        return
    with pytest.raises(InputError, match=r"plate\.ply: .* mm thick; give the object a thickness"):
        ObjectMesh.load(tmp_path / "plate.ply")


@pytest.mark.parametrize(
    ("name", "fix"),
    [
        ("gone.ply", "check the path"),
        ("text.ply", "use PLY|export it"),
        ("empty.stl", "use PLY|export it"),
        ("cut.stl", "cut off.*export or copy it again"),
        ("points.ply", "use PLY|export it"),
        ("millimetres.stl", "millimetres.*0.001"),
        ("part.STEP", "export it.*STL, in metres"),
        ("dust.stl", "0.1 mm.*in metres"),
        ("flat.ply", "export the mesh again"),
    ],
)
def test_unusable_files_are_refused(tmp_path, name, fix):
    bad_meshes(tmp_path)
    with pytest.raises(InputError, match=f"{name}: .*({fix})"):
        ObjectMesh.load(tmp_path / name)


def test_non_finite_vertices_are_refused(block):
    vertices = block.vertices.copy()
    vertices[3, 1] = np.nan
    with pytest.raises(InputError, match=r"broken.*export it again"):
        ObjectMesh.from_arrays(vertices, block.faces, "broken")


@pytest.mark.parametrize(
    ("vertices", "faces", "fix"),
    [
        (np.eye(3), np.array([[0, 1, 3]]), "vertex 3"),
        (np.eye(3), np.array([[0, 1, -1]]), "vertex -1"),
        (np.eye(3), np.array([[0, 1, 2, 0]]), "triangles"),
        (np.eye(4), np.array([[0, 1, 2]]), "triangles"),
        (np.empty((0, 3)), np.empty((0, 3), int), "export it"),
        (100 * np.eye(3), np.array([[0, 1, 2]]), "millimetres"),
    ],
)
def test_unusable_meshes_are_named(vertices, faces, fix):
    with pytest.raises(InputError, match=f"thing: .*{fix}"):
        ObjectMesh.from_arrays(vertices, faces, "thing")


@pytest.mark.parametrize("k", [1, 5])
def test_few_queries_are_answered_as_many_are(k):
    rng = np.random.default_rng(0)
    points = rng.standard_normal((500, 3))
    queries = rng.standard_normal((4 * FEWEST_THREADED_QUERIES, 3))
    tree = NearestPoints(points)
    distance, index = tree.query(queries, k)
    expected = np.linalg.norm(queries[:, None] - points, axis=2)
    np.testing.assert_array_equal(index.reshape(len(queries), k), np.argsort(expected, axis=1)[:, :k])
    for i, query in enumerate(queries):
        d, j = tree.query(query[None], k)
        np.testing.assert_array_equal(j[0], index[i])
        np.testing.assert_allclose(d[0], distance[i])


def box_with_slivers() -> tuple[np.ndarray, np.ndarray]:
    """A closed box, one of whose edges is divided on one side only: faces without area fill the T-junctions."""
    box = trimesh.creation.box([0.06, 0.04, 0.02])
    a, b, apex = box.faces[0]
    between = [box.vertices[a] + part * (box.vertices[b] - box.vertices[a]) for part in (0.3, 0.7)]
    first, second = len(box.vertices), len(box.vertices) + 1
    divided = [[a, first, apex], [first, second, apex], [second, b, apex], [a, b, second], [a, second, first]]
    return np.concatenate([box.vertices, between]), np.concatenate([box.faces[1:], divided])


def test_faces_without_area_are_welded_and_leave_no_hole():
    vertices, faces = box_with_slivers()
    assert trimesh.Trimesh(vertices, faces, process=False).is_watertight
    mesh = ObjectMesh.from_arrays(vertices, faces, "box")
    assert mesh.face_areas.min() > 1e-6
    assert mesh.area == pytest.approx(2 * (0.06 * 0.04 + 0.04 * 0.02 + 0.06 * 0.02))
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume == pytest.approx(0.06 * 0.04 * 0.02)


def test_a_face_without_area_beside_a_hole_is_dropped():
    corners = np.array([[0, 0, 0], [0.04, 0, 0], [0, 0.03, 0], [0.02, 0, 0]])
    mesh = ObjectMesh.from_arrays(corners, np.array([[0, 1, 2], [0, 1, 3]]), "open")
    assert mesh.faces.tolist() == [[0, 1, 2]]
