import json

import numpy as np
import pytest

from midastouch_perception import se3
from midastouch_perception.codebook import Codebook, build_codebook
from midastouch_perception.errors import InputError
from midastouch_perception.simulation.renderer import PenetrationRenderer
from midastouch_perception.tcn import load_tcn


@pytest.fixture(scope="module")
def tcn():
    return load_tcn("fast")


@pytest.fixture(scope="module")
def book(tool, tcn, sensor):
    return build_codebook(tool, tcn, sensor, size=800, seed=1)


def test_codes_are_those_of_the_poses(book, tool, tcn, sensor):
    rendered = PenetrationRenderer(tool, sensor.scaled(0.5)).render(book.poses[100:110])
    np.testing.assert_allclose(book.codes[100:110], tcn.encode(rendered), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(book.codes, axis=1), 1, atol=1e-5)


def test_survives_the_file(book, tool, tcn, tmp_path):
    path = tmp_path / "tool.npz"
    book.save(path)
    loaded = Codebook.load(path, mesh=tool, tcn=tcn.network_id)
    assert loaded.meta == book.meta
    np.testing.assert_allclose(loaded.poses, book.poses, atol=1e-6)
    np.testing.assert_allclose(loaded.codes, book.codes, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(loaded.codes, axis=1), 1, atol=1e-5)
    assert list(tmp_path.iterdir()) == [path]


def test_progress_and_seed(tool, tcn, sensor, book):
    seen = []
    again = build_codebook(tool, tcn, sensor, size=800, seed=1, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (800, 800)
    np.testing.assert_array_equal(again.codes, book.codes)


@pytest.mark.parametrize("size", [0, -3])
def test_empty_books_are_refused(tool, tcn, sensor, size):
    with pytest.raises(InputError, match="codebook size"):
        build_codebook(tool, tcn, sensor, size=size)


def test_one_entry_is_a_book(tool, tcn, sensor):
    assert build_codebook(tool, tcn, sensor, size=1).codes.shape == (1, tcn.dim)


def test_mismatches_are_named(book, tool, block, tmp_path):
    path = tmp_path / "tool.npz"
    book.save(path)
    with pytest.raises(InputError, match=r"built for the mesh 'handle_tool', not for this 'block'"):
        Codebook.load(path, mesh=block)
    with pytest.raises(InputError, match=r"built with the network tcn_fast-.*, not with tcn_other"):
        Codebook.load(path, mesh=tool, tcn="tcn_other")


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
        ({"meta": np.array(json.dumps({"format": 99}))}, "format 99"),
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


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such codebook file"):
        Codebook.load(tmp_path / "gone.npz")
