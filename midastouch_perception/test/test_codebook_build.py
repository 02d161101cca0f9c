import hashlib
import json

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook_build import CHUNK, CodebookBuild, build_codebook
from midastouch_perception.rendering.renderer import PenetrationRenderer

pytestmark = pytest.mark.usefixtures("no_symmetry_search")
SIZE = 2 * CHUNK + 40  # three chunks, the last one short


def digest(book):
    return hashlib.sha256(book.poses.tobytes() + book.codes.tobytes() + json.dumps(book.meta).encode()).hexdigest()


@pytest.fixture(scope="module")
def book(no_symmetry_search, tool, tcn, sensor):
    return build_codebook(tool, tcn, sensor, SIZE, seed=1)


@pytest.fixture(scope="module")
def interrupted(no_symmetry_search, tool, tcn, sensor, tmp_path_factory):
    """The file with what a build had done when Ctrl-C came after its first chunk."""
    build = CodebookBuild(tool, tcn, sensor, SIZE, seed=1)

    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build.run(progress=interrupt)
    assert build.done == CHUNK
    build.save(path := tmp_path_factory.mktemp("first") / "part.npz")
    return path


def test_codes_are_those_of_the_poses(book, tool, tcn, sensor):
    rendered = PenetrationRenderer(tool, sensor.scaled(0.5)).render(book.poses[250:262])
    np.testing.assert_allclose(book.codes[250:262], tcn.encode(rendered), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(book.codes, axis=1), 1, atol=1e-5)
    assert book.meta["size"] == len(book.poses) == SIZE


def test_whoever_is_asked_between_two_pieces_of_work_can_end_it(tool, tcn, sensor, book):
    pause = iter([0, 0]).__next__
    build = CodebookBuild(tool, tcn, sensor, SIZE, seed=1)
    with pytest.raises(StopIteration):
        build.run(pause=pause)
    assert build.done < SIZE
    assert digest(build.run()) == digest(book)


def test_interruptions_do_not_change_the_result(tool, tcn, sensor, book, interrupted):
    encoded = []

    class Counting:
        network_id, dim, calibration = tcn.network_id, tcn.dim, tcn.calibration

        def encode(self, maps):
            encoded.append(len(maps))
            return tcn.encode(maps)

    build = CodebookBuild(tool, Counting(), sensor, SIZE, seed=1)
    build.restore(interrupted)
    seen = []
    assert digest(build.run(jobs=2, progress=lambda done, total: seen.append((done, total)))) == digest(book)
    assert seen == [(2 * CHUNK, SIZE), (SIZE, SIZE)]
    assert sorted(encoded) == [SIZE - 2 * CHUNK, CHUNK]


def test_a_seed_makes_a_difference(tool, tcn, sensor, book):
    assert not np.array_equal(build_codebook(tool, tcn, sensor, 20, seed=2).poses, book.poses[:20])


@pytest.mark.parametrize(
    ("change", "said"),
    [({"seed": 2}, "another seed"), ({"size": SIZE + 1}, "another size"), ({"mesh": "block"}, "another mesh_name")],
)
def test_parts_of_another_build_are_refused(tool, block, tcn, sensor, interrupted, change, said):
    mesh = block if change.pop("mesh", None) else tool
    build = CodebookBuild(mesh, tcn, sensor, **({"size": SIZE, "seed": 1} | change))
    with pytest.raises(InputError, match=f"part.npz: .*{said}"):
        build.restore(interrupted)
    assert build.done == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"finished": None}, "not an unfinished codebook"),
        ({"finished": np.ones(7, bool)}, "missing or non-finite"),
        ({"codes": np.full((SIZE, 64), np.nan, np.float32)}, "missing or non-finite"),
        ({"meta": np.array("[]")}, "another format"),
    ],
)
def test_broken_parts_are_refused(tool, tcn, sensor, interrupted, tmp_path, change, said):
    with np.load(interrupted) as data:
        content = dict(data) | change
    np.savez(tmp_path / "part.npz", **{k: v for k, v in content.items() if v is not None})
    with pytest.raises(InputError, match=f"part.npz: .*{said}"):
        CodebookBuild(tool, tcn, sensor, SIZE, seed=1).restore(tmp_path / "part.npz")


@pytest.mark.parametrize("size", [0, -3])
def test_empty_books_are_refused(tool, tcn, sensor, size):
    with pytest.raises(InputError, match="codebook size"):
        build_codebook(tool, tcn, sensor, size=size)


def test_a_mesh_whose_faces_disagree_on_outside_is_refused(tool, tcn, sensor):
    turned = np.random.default_rng(0).random(len(tool.faces)) < 0.1
    faces = np.where(turned[:, None], tool.faces[:, ::-1], tool.faces)
    with pytest.raises(InputError, match=r"part: .*normals"):
        CodebookBuild(ObjectMesh.from_arrays(tool.vertices, faces, "part"), tcn, sensor, 4).run()
