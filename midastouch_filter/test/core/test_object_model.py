"""Books and meshes that nobody should give the filter: refused by name, or of use none the less."""

import numpy as np
import pytest
import trimesh
from filter_runs import assert_defined, meta_of, model_of, some_book

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core import object_model
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.object_model import of_surface
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook

SMALL = FilterConfig(max_particles=300, threads=1)


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


def followed(model) -> tuple[bytes, bytes]:
    entries = np.roll(np.arange(len(model.lookup)), 1)
    particles = Particles.from_poses(model.lookup.poses, entries)
    distance = model.lookup.follow(particles)
    return particles.entries.tobytes(), distance.tobytes()


def near(model) -> bytes:
    """What a model has of the surface."""
    points = model.lookup.poses[:100, :3, 3]
    faces = np.zeros(100, int)
    return model.surface.distance(points).tobytes() + model.normals.at(points, faces).tobytes()


def test_a_symmetry_that_the_codebook_lacks_is_searched_for_its_sensor(world, monkeypatch):
    monkeypatch.setattr(object_model, "object_symmetry", lambda mesh, sensor, poses: (mesh, sensor.name, poses))
    book = some_book(world, world.mesh, sensor="digit_tacto")
    assert object_model.symmetry_of(world.mesh, book) == (world.mesh, "digit_tacto", book.poses)


def test_kept_arrays_are_those_that_would_be_made(world):
    kept = model_of(world)
    made = model_of(world, world.make_codebook(world.poses, world.codebook.codes))
    assert followed(kept) == followed(made)
    assert near(kept) == near(made)


def test_surface_data_of_a_codebook_hold_for_a_part_of_it(world):
    whole, poses = world.codebook, world.poses[:500]
    part = model_of(world, world.make_codebook(poses, whole.codes[:500], of_surface(whole.derived)))
    made = model_of(world, world.make_codebook(poses, whole.codes[:500]))
    assert followed(part) == followed(made)
    assert near(part) == near(made)


def test_a_model_takes_the_entries_of_a_denser_codebook(world):
    coarse = model_of(world, world.make_codebook(world.poses[:500], world.codebook.codes[:500], world.of_surface))
    lookup = coarse.lookup
    coarse.take(coarse.with_codebook(world.codebook))
    whole = model_of(world)
    assert len(lookup) == len(world.poses)
    assert followed(coarse) == followed(whole)
    assert near(coarse) == near(whole)
    assert coarse.density == whole.density
    np.testing.assert_array_equal(coarse.order, whole.order)


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
def test_broken_arrays_are_refused_naming_the_file(world, name, change, tmp_path):
    whole = world.codebook
    key = next(key for key in whole.derived if key.endswith(name))
    derived = whole.derived | {key: change(whole.derived[key])}
    Codebook(whole.poses, whole.codes, meta_of(world.mesh, sensor="", tcn="fourier-test"), derived).save(
        tmp_path / "broken.npz"
    )
    with pytest.raises(InputError, match=r"broken\.npz: .*build-codebook"):
        model_of(world, Codebook.load(tmp_path / "broken.npz"))
