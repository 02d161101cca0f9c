"""What is kept with a codebook is what would be made anew, and nothing else is taken for it."""

import dataclasses

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.object_index import ObjectIndex, derived_arrays
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers
from midastouch_perception.codebook import FORMAT, Codebook

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
    with pytest.raises(InputError, match=r"broken\.npz: .*; build it again"):
        indexed(world, Codebook.load(tmp_path / "broken.npz"))
