"""Books and meshes that nobody should give the filter: refused by name, or of use none the less."""

import dataclasses

import numpy as np
import pytest
import trimesh
from filter_runs import assert_defined, codes_along, some_book

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.object_model import ObjectIndex, derived_arrays
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import FORMAT, Codebook

SMALL = FilterConfig(max_particles=300, min_particles=50, threads=1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p, c: (p, c[:-1]), "299 codes.*300 poses"),
        (lambda p, c: (p[:-1], c), "300 codes.*299 poses"),
        (lambda p, c: (p, c.ravel()), r"codes of shape \(19200,\)"),
        (lambda p, c: (p, np.empty((300, 0))), r"codes of shape \(300, 0\)"),
        (lambda p, c: (p, np.where(c > 0, np.nan, c)), "codes.*build-codebook"),
        (lambda p, c: (np.where(p == 1, np.nan, p), c), "poses.*build-codebook"),
        (lambda p, c: (p[:, :3], c), r"poses of shape \(300, 3, 4\)"),
        (lambda p, c: (p[:1], c[:1]), "1 poses"),
        (lambda p, c: (p[:0], c[:0]), r"poses of shape \(0, 4, 4\)"),
    ],
)
def test_books_that_do_not_fit_together_are_refused(world, change, said):
    poses = world.random_poses(world.mesh, 300, np.random.default_rng(2))
    book = world.make_codebook(*change(poses, world.encode(poses)), world.of_surface)
    with pytest.raises(InputError, match=f"codebook: .*{said}"):
        ParticleFilter(world.mesh, book, SMALL, 0)


@pytest.mark.parametrize("key", ["temperature", "outlier"])
def test_a_book_without_calibration_is_refused(world, key):
    book = some_book(world, world.mesh)
    del book.meta[key]
    with pytest.raises(InputError, match=f"{key}.*build it again"):
        ParticleFilter(world.mesh, book, SMALL, 0)
    for unusable in (np.nan, np.inf, -1.0, "warm"):
        book.meta[key] = unusable
        with pytest.raises(InputError, match=f"{key}.*build it again"):
            ParticleFilter(world.mesh, book, SMALL, 0)


def shapes():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    mixed = ball.faces.copy()
    mixed[::3] = mixed[::3, ::-1]
    plate = np.array([[0, 0, 0], [0.04, 0, 0], [0, 0.04, 0], [0.04, 0.04, 0]])
    flat = np.concatenate([ball.faces, [[0, 0, 1], [2, 2, 2], [3, 4, 3]]])
    fin = np.concatenate([ball.faces, [[0, 5, 9], [0, 5, 20], [0, 5, 30]]])
    soup = ball.vertices[ball.faces].reshape(-1, 3)
    return {
        "inverted": (ball.vertices, ball.faces[:, ::-1]),
        "mixed winding": (ball.vertices, mixed),
        "zero-area faces": (ball.vertices, flat),
        "non-manifold": (ball.vertices, fin),
        "every face twice, both ways": (ball.vertices, np.concatenate([ball.faces, ball.faces[:, ::-1]])),
        "unwelded": (soup, np.arange(len(soup)).reshape(-1, 3)),
        "open": (ball.vertices, ball.faces[:200]),
        "plate without thickness": (plate, np.array([[0, 1, 2], [1, 3, 2]])),
        "one triangle": (plate[:3], np.array([[0, 1, 2]])),
        "needle": (plate[:3] * [1, 1e-9, 1], np.array([[0, 1, 2]])),
        "unused vertex far away": (np.concatenate([ball.vertices, [[1e6, 0, 0]]]), ball.faces),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", shapes())
def test_degenerate_meshes_work(world, name):
    mesh = ObjectMesh.from_arrays(*shapes()[name], name)
    book = some_book(world, mesh, 200, sensor="digit_tacto")
    filter_ = ParticleFilter(mesh, book, SMALL, 0)
    filter_.initialise_uniform()
    penetration = np.full((80, 60), 1e-4, np.float32)
    step = se3.exp([5e-4, 0, 0, 0, 0, 0.01])
    for k in range(4):
        estimate = filter_.step(step, Measurement(True, book.codes[k], penetration=penetration))
        assert_defined(filter_, estimate)


@pytest.mark.slow
def test_a_book_in_millimetres_is_lost_with_a_reason(world):
    poses = world.random_poses(world.mesh, 300, np.random.default_rng(2))
    codes = world.encode(poses)
    poses[:, :3, 3] *= 1000
    filter_ = ParticleFilter(world.mesh, world.make_codebook(poses, codes), SMALL, 0)
    filter_.initialise_uniform()
    for motion, code in codes_along(world, 3):
        estimate = filter_.step(motion, Measurement(True, code))
        assert_defined(filter_, estimate)
    assert estimate.status.state == state.LOST


@pytest.mark.slow
def test_a_book_that_holds_every_pose_twice_works(world):
    poses = np.repeat(world.random_poses(world.mesh, 200, np.random.default_rng(2)), 2, axis=0)
    filter_ = ParticleFilter(world.mesh, world.make_codebook(poses, world.encode(poses)), SMALL, 0)
    filter_.initialise_uniform()
    for motion, code in codes_along(world, 4):
        assert_defined(filter_, filter_.step(motion, Measurement(True, code)))


CONFIG = FilterConfig()


@pytest.fixture(scope="module")
def codebook(world):
    book = Codebook(world.poses, np.ones((len(world.poses), 4), np.float32), {})
    book.derived = derived_arrays(world.mesh, book)
    return book


def indexed(world, codebook, config=CONFIG) -> ObjectIndex:
    return ObjectIndex(world.mesh, codebook, config, Workers(1))


def followed(index: ObjectIndex) -> tuple[bytes, bytes]:
    entries = np.roll(np.arange(len(index.lookup.poses)), 1)
    particles = Particles.from_poses(index.lookup.poses, entries)
    distance = index.lookup.follow(particles)
    return particles.entries.tobytes(), distance.tobytes()


def test_a_kept_index_is_the_one_that_would_be_made(world, codebook):
    kept = indexed(world, codebook)
    made = indexed(world, Codebook(codebook.poses, codebook.codes, {}))
    assert followed(kept) == followed(made)
    assert kept.lookup.stride == made.lookup.stride
    np.testing.assert_array_equal(kept.surface.values, made.surface.values)
    np.testing.assert_array_equal(kept.normals.values, made.normals.values)


def test_it_outlives_a_file(world, codebook, tmp_path):
    codebook.save(tmp_path / "book.npz")
    with np.load(tmp_path / "book.npz", allow_pickle=False) as file:
        for name, array in codebook.derived.items():
            np.testing.assert_array_equal(file[name], array)


def test_other_limits_ask_for_another_grid(world, codebook):
    wider = dataclasses.replace(CONFIG, dead_distance=1.5 * CONFIG.dead_distance)
    assert indexed(world, codebook, wider).surface.limit > indexed(world, codebook).surface.limit


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("links", lambda a: np.full_like(a, len(a))),
        ("links", lambda a: a[:-1]),
        ("links", lambda a: a[:, :0]),
        ("neighbours", lambda a: -np.ones_like(a)),
        ("distances", lambda a: a[1:]),
        ("distances", lambda a: a.astype(float)),
        ("normals", lambda a: a[1:]),
    ],
)
def test_broken_arrays_are_refused_naming_the_file(world, codebook, name, change, tmp_path):
    key = next(key for key in codebook.derived if key.endswith(name))
    meta = dict.fromkeys(("mesh_name", "mesh_sha256", "sensor", "sensor_id", "tcn"), "") | {"format": FORMAT}
    derived = codebook.derived | {key: change(codebook.derived[key])}
    Codebook(codebook.poses, codebook.codes, meta, derived).save(tmp_path / "broken.npz")
    with pytest.raises(InputError, match=r"broken\.npz: .*build-codebook"):
        indexed(world, Codebook.load(tmp_path / "broken.npz"))
