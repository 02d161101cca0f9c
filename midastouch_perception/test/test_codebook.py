import io
import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import FORMAT, PRESS, YAWS, Codebook, codebook_poses, mapped_npz
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import Reachability

pytestmark = pytest.mark.usefixtures("no_symmetry_search")


@pytest.fixture(scope="module")
def book(no_symmetry_search, tool, tcn, sensor):
    return build_codebook(tool, tcn, sensor, size=800, seed=1)


def test_survives_the_file(book, tool, tcn, tmp_path):
    path = tmp_path / "tool.npz"
    book.save(path)
    loaded = Codebook.load(path, mesh=tool, tcn=tcn.network_id)
    assert loaded.meta == book.meta
    np.testing.assert_allclose(loaded.poses, book.poses, atol=1e-6)
    np.testing.assert_allclose(loaded.codes, book.codes, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(loaded.codes, axis=1), 1, atol=1e-5)
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_size < len(book.poses) * (2 * tcn.dim + 4 * 7) + 6000, "the largest one must fit into 30 MB"


def test_mismatches_are_named(book, tool, block, tmp_path):
    path = tmp_path / "tool.npz"
    book.save(path)
    with pytest.raises(InputError, match=r"handle_tool.*block.*build-codebook block"):
        Codebook.load(path, mesh=block)
    with pytest.raises(InputError, match=r"tcn_fast-.*tcn_other.*build it again"):
        Codebook.load(path, mesh=tool, tcn="tcn_other")


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 1e4), (1.0, 0.02), (1e3, 0.0)])
def test_poses_off_the_mesh_are_refused_with_both_files(book, tool, tmp_path, scale, shift):
    path, mesh_path = tmp_path / "tool.npz", tmp_path / "tool.ply"
    tool.save(mesh_path)
    mesh = ObjectMesh.load(mesh_path)
    poses = book.poses.copy()
    poses[:, :3, 3] = scale * poses[:, :3, 3] + shift
    Codebook(poses, book.codes, {**book.meta, "mesh_sha256": mesh.sha256}).save(path)
    with pytest.raises(InputError, match=r"tool\.npz: .*tool\.ply.*build-codebook"):
        Codebook.load(path, mesh=mesh)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"codes": None}, "not a codebook"),
        ({"codes": np.full((800, 8), np.nan, np.float16)}, "non-finite"),
        ({"codes": np.ones((3, 8), np.float16)}, "do not fit"),
        ({"codes": np.empty((0, 8), np.float16), "poses": np.empty((0, 7), np.float32)}, "do not fit"),
        ({"codes": np.zeros(800, [("a", float), ("b", float)])}, "not a codebook"),
        ({"poses": np.full((800, 7), "x")}, "not a codebook"),
        ({"poses": np.full((800, 7), np.nan, np.float32)}, "non-finite"),
        ({"poses": np.zeros((800, 7), np.float32)}, "unit length"),
        ({"codes": np.zeros((800, 8), np.float16)}, "unit length"),
        ({"codes": np.full((800, 8), 1e30, np.float32)}, "unit length"),
        ({"checksum": np.array(1)}, "not those that were written"),
        ({"meta": np.array(json.dumps({"format": 99}))}, "format 99"),
        ({"meta": np.array(json.dumps({"format": FORMAT}))}, "without its mesh_name, .*tcn"),
        ({"meta": np.array("[]")}, "not a codebook"),
        ({"meta": np.array(["{}"], object)}, "not a codebook"),
    ],
)
def test_broken_files_are_refused(book, tmp_path, change, said):
    book.save(path := tmp_path / "bad.npz")
    with np.load(path) as saved:
        content = dict(saved, checksum=None) | change
    np.savez(path, **{name: value for name, value in content.items() if value is not None})
    with pytest.raises(InputError, match=f"bad.npz: .*{said}"):
        Codebook.load(path)


@pytest.mark.parametrize("first", [None, 5])
def test_a_damaged_description_is_refused(book, tmp_path, first):
    """Also where only the beginning is read, whose checksum is not known."""
    book.save(path := tmp_path / "bad.npz")
    path.write_bytes(path.read_bytes().replace(b"f\0\0\0o\0\0\0c\0\0\0a\0\0\0l", b"f\0\0\0a\0\0\0c\0\0\0a\0\0\0l"))
    with pytest.raises(InputError, match=r"bad\.npz: not a codebook .*CRC"):
        Codebook.load(path, first=first)


def npy() -> bytes:
    np.save(stream := io.BytesIO(), np.zeros(3))
    return stream.getvalue()


def damaged() -> bytes:
    np.savez_compressed(stream := io.BytesIO(), poses=np.random.default_rng(0).random((500, 7)))
    content = bytearray(stream.getvalue())
    content[60:400] = bytes(value ^ 0x5A for value in content[60:400])
    return bytes(content)


@pytest.mark.parametrize("first", [None, 5])
@pytest.mark.parametrize(
    "content",
    [None, b"", b"not a zip", b"PK\x03\x04 cut", b"PK\x05\x06 and no more", npy(), damaged(), "half"],
    ids=["none", "empty", "text", "cut", "end alone", "npy", "damaged", "half"],
)
def test_foreign_and_cut_files_are_refused(book, tmp_path, content, first):
    path = tmp_path / "foreign.npz"
    if content == "half":
        book.save(path)
        content = path.read_bytes()[: path.stat().st_size // 2]
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"foreign\.npz: .*build-codebook"):
        Codebook.load(path, first=first)


def test_the_first_poses_are_read_alone(book, tmp_path):
    book.save(path := tmp_path / "book.npz")
    whole, head = Codebook.load(path), Codebook.load(path, first=5)
    assert np.array_equal(head.poses, whole.poses[:5])
    assert np.array_equal(head.codes, whole.codes[:5])
    assert head.meta == whole.meta
    assert head.derived == {}


def test_arrays_are_those_of_the_file_and_lie_on_the_disk(tmp_path):
    arrays = {"table": np.arange(12.0).reshape(3, 4), "word": np.array("words"), "none": np.zeros((0, 7))}
    arrays["by_columns"] = np.asfortranarray(np.arange(6).reshape(2, 3))
    np.savez(tmp_path / "some.npz", **arrays)
    found = mapped_npz(tmp_path / "some.npz")
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)
    with pytest.raises(ValueError, match="read-only"):
        found["table"][0] = 1.0


def test_what_cannot_be_mapped_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "small.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=r"a\.npy is compressed"):
        mapped_npz(tmp_path / "small.npz")
    np.savez(tmp_path / "objects.npz", a=np.array([{}], object))
    with pytest.raises(ValueError, match="holds objects"):
        mapped_npz(tmp_path / "objects.npz")


def sites_of(poses):
    """Contact points (S, 3) of poses, each once."""
    return np.unique((poses[:, :3, 3] + PRESS * poses[:, :3, 2]).round(6), axis=0)


@pytest.fixture(scope="module")
def poses(tool, sensor):
    return codebook_poses(tool, 4000, sensor, np.random.default_rng(0))


def test_covers_the_surface_without_holes(poses, tool):
    """Every reachable surface point has an entry within about two mean spacings."""
    points, _, _ = tool.sample_surface(2000, np.random.default_rng(1))
    spacing = np.sqrt(tool.area / (len(poses) / YAWS))
    distance = cKDTree(sites_of(poses)).query(points)[0]
    assert np.quantile(distance, 0.98) < 1.5 * spacing


def test_a_ball_is_covered_more_evenly_than_by_chance(sensor):
    """No two sites nearer than 0.6 spacings, with which they have to be everywhere; by chance it were 0.1."""
    ball = ObjectMesh.load(bundled_objects()["ball"])
    for seed in range(4):
        sites = sites_of(codebook_poses(ball, 150 * YAWS, sensor, np.random.default_rng(seed)))
        assert len(sites) == 150
        assert cKDTree(sites).query(sites, 2)[0][:, 1].min() > 0.6 * np.sqrt(ball.area / 150)


def test_edges_get_more(block, sensor):
    """Per area, 1.3 times and more within 2 mm of the middle of a round edge."""
    poses = codebook_poses(block, 3000, sensor, np.random.default_rng(0))

    def near_edge(points):
        half = np.array([0.02, 0.015, 0.01])
        return (np.sort(half - np.abs(points), axis=1)[:, 1] < 2e-3).mean()

    share_of_area = near_edge(block.sample_surface(20_000, np.random.default_rng(1))[0])
    assert near_edge(sites_of(poses)) > 1.3 * share_of_area


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_all_entries_can_be_reached(name, sensor):
    mesh = ObjectMesh.load(bundled_objects()[name])
    poses = codebook_poses(mesh, 400, sensor, np.random.default_rng(2))
    settled, reachable = Reachability(mesh, sensor).settle(poses, np.full(len(poses), PRESS))
    assert reachable.all()
    np.testing.assert_allclose(settled, poses, atol=2e-4)


def test_yaw_is_even(poses):
    contact = (poses[:, :3, 3] + PRESS * poses[:, :3, 2]).round(6)
    _, site, count = np.unique(contact, axis=0, return_inverse=True, return_counts=True)
    full = np.flatnonzero(count == YAWS)
    assert len(full) > 50
    for index in full[:20]:
        here = poses[site.reshape(-1) == index]
        turns = np.arctan2(here[:, :3, 0] @ here[0, :3, 1], here[:, :3, 0] @ here[0, :3, 0])
        np.testing.assert_allclose(np.diff(np.sort(turns)), 2 * np.pi / YAWS, atol=1e-6)


@pytest.mark.slow
def test_an_object_out_of_reach_is_said(sensor):
    """A one-sided plate, approached from behind: nothing to touch."""
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0]])
    plate = ObjectMesh.from_arrays(corners, np.array([[0, 1, 2], [0, 2, 3]]), "plate")
    plate.face_normals = -plate.face_normals
    found = []
    with pytest.raises(InputError, match=r"plate: the gel reaches only 0\.0% of the poses.*; close gaps"):
        codebook_poses(plate, 50_000, sensor, np.random.default_rng(0), searched=found.append)
    assert found == [0] * (4096 // 512), "it ends long before all of the 100,000 first ones were tried"


@pytest.mark.parametrize("size", [1, 5, 17, 333, 1500])
def test_sizes_are_exact_and_the_search_tells_how_far_it_is(tool, sensor, size):
    found = []
    poses = codebook_poses(tool, size, sensor, np.random.default_rng(0), searched=found.append)
    assert found == sorted(found)
    assert found[-1] == len(poses) == size
    assert size < 1500 or len(found) > 2
