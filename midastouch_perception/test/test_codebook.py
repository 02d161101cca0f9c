import json

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import FORMAT, Codebook, mapped_npz
from midastouch_perception.codebook_build import build_codebook


@pytest.fixture(scope="module")
def book(tool, tcn, sensor):
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


def test_the_longest_codes_of_the_largest_book_fit_into_30_mb(book, tmp_path):
    rng = np.random.default_rng(0)
    poses = se3.make(se3.random_rotations(50_000, rng), rng.uniform(-0.1, 0.1, (50_000, 3)))
    path = tmp_path / "large.npz"
    Codebook(poses, rng.standard_normal((50_000, 256), np.float32), book.meta).save(path)
    assert path.stat().st_size < 30e6
    assert Codebook.load(path).codes.shape == (50_000, 256)


def test_mismatches_are_named(book, tool, block, tmp_path):
    path = tmp_path / "tool.npz"
    book.save(path)
    with pytest.raises(InputError, match=r"built for the mesh 'handle_tool', not for this 'block'"):
        Codebook.load(path, mesh=block)
    with pytest.raises(InputError, match=r"built with the network tcn_fast-.*, not with tcn_other"):
        Codebook.load(path, mesh=tool, tcn="tcn_other")


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 1e4), (1.0, 0.02), (1e3, 0.0)])
def test_poses_that_are_not_on_the_mesh_are_refused_with_both_files(book, tool, tmp_path, scale, shift):
    """As of a codebook in millimetres, or one whose poses were moved."""
    path, mesh_path = tmp_path / "tool.npz", tmp_path / "tool.ply"
    tool.save(mesh_path)
    mesh = ObjectMesh.load(mesh_path)
    poses = book.poses.copy()
    poses[:, :3, 3] = scale * poses[:, :3, 3] + shift
    Codebook(poses, book.codes, {**book.meta, "mesh_sha256": mesh.sha256}).save(path)
    with pytest.raises(InputError, match=r"tool\.npz: .* mm outside the mesh .*tool\.ply; .*build-codebook"):
        Codebook.load(path, mesh=mesh)


def broken(book, path, **change):
    data = {
        "poses": se3.to_xyzquat(book.poses).astype(np.float32),
        "codes": book.codes.astype(np.float16),
        "meta": np.array(json.dumps(book.meta)),
    }
    data.update(change)
    np.savez(path, **{k: v for k, v in data.items() if v is not None})


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
        ({"meta": np.array(json.dumps({"format": 99}))}, "format 99"),
        ({"meta": np.array(json.dumps({"format": FORMAT}))}, "does not say its mesh_name, .*tcn"),
        ({"meta": np.array("[]")}, "not a codebook"),
        ({"meta": np.array(["{}"], object)}, "not a codebook"),
    ],
)
def test_broken_files_are_refused(book, tmp_path, change, said):
    path = tmp_path / "bad.npz"
    broken(book, path, **change)
    with pytest.raises(InputError, match=f"bad.npz: .*{said}"):
        Codebook.load(path)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 truncated"])
def test_foreign_files_are_refused(tmp_path, content):
    path = tmp_path / "foreign.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a codebook"):
        Codebook.load(path)


def test_a_single_array_is_refused(tmp_path):
    with (tmp_path / "array.npz").open("wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(InputError, match=r"array\.npz: not a codebook"):
        Codebook.load(tmp_path / "array.npz")


def test_a_damaged_archive_is_refused(tmp_path):
    path = tmp_path / "damaged.npz"
    np.savez_compressed(path, poses=np.random.default_rng(0).random((500, 7)))
    content = bytearray(path.read_bytes())
    content[60:400] = bytes(value ^ 0x5A for value in content[60:400])
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"damaged\.npz: not a codebook"):
        Codebook.load(path)


def test_half_a_file_is_refused(book, tmp_path):
    path = tmp_path / "half.npz"
    book.save(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"half\.npz: not a codebook"):
        Codebook.load(path)


@pytest.mark.parametrize("length", [1, 16, 256])
def test_codes_may_have_any_length(book, tmp_path, length):
    codes = np.random.default_rng(0).standard_normal((len(book.poses), length))
    Codebook(book.poses, codes, book.meta).save(tmp_path / "book.npz")
    loaded = Codebook.load(tmp_path / "book.npz").codes
    np.testing.assert_allclose(loaded, codes / np.linalg.norm(codes, axis=1, keepdims=True), atol=1e-3)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such codebook file"):
        Codebook.load(tmp_path / "gone.npz")


def test_the_first_poses_are_read_alone(book, tmp_path):
    book.save(path := tmp_path / "book.npz")
    whole, head = Codebook.load(path), Codebook.load(path, first=5)
    assert np.array_equal(head.poses, whole.poses[:5])
    assert np.array_equal(head.codes, whole.codes[:5])
    assert head.meta == whole.meta
    assert head.derived == {}


def test_the_first_poses_of_a_broken_file_are_refused(tmp_path):
    (tmp_path / "book.npz").write_bytes(b"PK\x05\x06 and no more")
    with pytest.raises(InputError, match=r"book\.npz: not a codebook"):
        Codebook.load(tmp_path / "book.npz", first=5)


def test_arrays_are_those_of_the_file_and_lie_on_the_disk(tmp_path):
    arrays = {
        "flat": np.arange(12, dtype=np.float16),
        "table": np.arange(12.0).reshape(3, 4),
        "by_columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "word": np.array("words"),
        "none": np.zeros((0, 7)),
    }
    np.savez(tmp_path / "some.npz", **arrays)
    found = mapped_npz(tmp_path / "some.npz")
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)
    assert isinstance(found["table"], np.memmap)
    with pytest.raises(ValueError, match="read-only"):
        found["table"][0] = 1.0


def test_what_cannot_be_mapped_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "small.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=r"a\.npy is compressed"):
        mapped_npz(tmp_path / "small.npz")
    np.savez(tmp_path / "objects.npz", a=np.array([{}], object))
    with pytest.raises(ValueError, match="holds objects"):
        mapped_npz(tmp_path / "objects.npz")
