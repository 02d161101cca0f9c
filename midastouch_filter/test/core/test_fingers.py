"""What one finger measures beside others: its likelihood, what of it counts, and what is refused."""

import math

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.fingers import Finger, Fingers, count
from midastouch_filter.core.gates import Gates
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.measurement_model import MeasurementModel
from midastouch_filter.core.motion_model import Odometry, transformed
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.surface import SurfaceConstraint, SurfaceGrid
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_perception.simulation.slide import measure_poses

CONFIG = FilterConfig(max_particles=3000, min_particles=300, threads=1, converged_translation=7e-3)
MOVED = se3.exp(np.array([2e-3, 0, 0, 0, 0, 0.05]))


@pytest.fixture(scope="module")
def parts(world):
    """lookup, surface, model, workers: what fingers are made of."""
    workers = Workers(1)
    lookup = PoseLookup(world.poses, workers)
    model = MeasurementModel(world.codebook.codes, world.codebook.meta, CONFIG, workers)
    grid = SurfaceGrid(world.mesh, CONFIG.dead_distance)
    surface = SurfaceConstraint(grid, lookup.largest_gap, CONFIG, workers)
    return lookup, surface, model, workers


@pytest.fixture
def gates():
    return Gates()


@pytest.fixture
def make_finger(parts, gates):
    lookup, surface, model, workers = parts
    return lambda name: Finger(name, lookup, surface, model.for_another_sensor(), CONFIG, workers, gates)


@pytest.fixture
def fingers(make_finger, gates):
    return Fingers(make_finger, None, gates)


def measured(fingers, motion=None, explained=(), **touches):
    """Those that measure something new after the first one moved by `motion` (4, 4)."""
    return fingers.measure(touches, None if motion is None else Odometry.from_matrix(motion), explained)


def touch(T_gel_finger, code=None, **changes):
    return Measurement(code is not None, code, T_gel_finger=T_gel_finger, **changes)


@pytest.fixture(scope="module")
def cloud(parts, world):
    """Particles about poses of the book, as a filter has them."""
    lookup, *_ = parts
    rng = np.random.default_rng(7)
    poses = measure_poses(world.poses[rng.integers(0, 8000, 1500)], rng, 1e-3, 0.05)
    return Particles.from_poses(poses, lookup.exact(poses))


# --------------------------------------------------------------------------- likelihood of one further finger


def test_where_the_reference_is_a_finger_weighs_like_it(fingers, parts, cloud, world):
    lookup, surface, model, _ = parts
    code = world.encode(world.poses[:1])[0]
    (evidence,) = measured(fingers, copy=touch(np.eye(4), code))
    distance = lookup.follow(cloud)
    model.score_occupied(code, cloud)
    expected = surface.log_weight(cloud, distance) + model.log_likelihood(cloud)
    alive = np.isfinite(expected) & (distance < 0.9 * surface.reach)
    assert alive.mean() > 0.9
    np.testing.assert_allclose(evidence.log_ratio(cloud, None)[alive], expected[alive], atol=0.05)


def test_poses_are_transformed_to_the_finger(cloud):
    T_gel_finger = se3.exp(np.array([0.03, -0.05, 0.02, 1.0, -2.0, 0.5]))
    there = transformed(cloud, T_gel_finger, Workers(1))
    np.testing.assert_allclose(there.poses, cloud.poses @ T_gel_finger, atol=1e-6)
    np.testing.assert_array_equal(there.entries, cloud.entries)


def test_the_particle_that_has_both_fingers_right_is_weighed_best(fingers, world, parts):
    lookup, *_ = parts
    rng = np.random.default_rng(3)
    right = 0
    for _ in range(20):
        gels = world.random_poses(world.mesh, 2, rng)
        code = world.encode(gels[1:])[0]
        poses = np.concatenate([gels[:1], world.random_poses(world.mesh, 200, rng)])
        particles = Particles.from_poses(poses, lookup.exact(poses))
        fingers.restart()
        (evidence,) = measured(fingers, other=touch(se3.inverse(gels[0]) @ gels[1], code))
        right += evidence.log_ratio(particles, None).argmax() == 0
    assert right >= 18


def test_far_from_the_surface_nothing_is_proven(fingers, cloud, world):
    code = world.encode(world.poses[:1])[0]
    (evidence,) = measured(fingers, other=touch(se3.translation([0, 0, 0.5]), code))
    log_ratio = evidence.log_ratio(cloud, None)
    assert np.isfinite(log_ratio).all()
    assert (log_ratio <= math.log(0.05)).all()


def test_a_finger_that_touches_nothing_is_only_kept_out_of_the_object(fingers, parts, cloud):
    inside, outside, aside = (se3.translation([0, 0, z]) for z in (-5e-3, 5e-3, 0.3))
    weights = []
    for pose in (inside, outside, aside):
        fingers.restart()
        (evidence,) = measured(fingers, other=touch(pose))
        weights.append(evidence.log_ratio(cloud, None))
    assert np.median(weights[0]) < -1
    assert np.median(weights[1]) == 0
    np.testing.assert_array_equal(weights[2], 0)
    depth = -parts[1].distance(transformed(cloud, inside, Workers(1)))
    assert np.corrcoef(depth, weights[0])[0, 1] < -0.5


def test_walks_find_the_entries_that_a_search_would(fingers, parts, world, monkeypatch):
    """Along a slide, with particles that are spread and fingers that move against each other."""
    lookup, surface, *_ = parts
    rng = np.random.default_rng(5)
    slides = [world.make_slide(world.mesh, 30, rng) for _ in range(2)]
    start = measure_poses(np.repeat(slides[0][:1], 1000, axis=0), rng, 5e-3, 0.2)
    walked = []
    follow = PoseLookup.follow

    def spied(self, particles):
        found = follow(self, particles)
        walked.append((found, particles.poses))
        return found

    monkeypatch.setattr(PoseLookup, "follow", spied)
    late = good = 0
    for k in range(30):
        poses = start @ se3.inverse(slides[0][0]) @ slides[0][k]
        particles = Particles.from_poses(poses, lookup.exact(poses))
        T_gel_finger = se3.inverse(slides[0][k]) @ slides[1][k]
        (evidence,) = measured(fingers, MOVED, other=touch(T_gel_finger, world.encode(slides[1][k : k + 1])[0]))
        evidence.log_ratio(particles, None)
        found, there = walked.pop()
        nearest = world.poses[lookup.exact(there)]
        angle = se3.rotation_angle(np.swapaxes(there[:, :3, :3], 1, 2) @ nearest[:, :3, :3])
        exact = np.hypot(np.linalg.norm(there[:, :3, 3] - nearest[:, :3, 3], axis=1), 0.02 * np.sin(angle / 2))
        near = exact < surface.reach
        good += (found[near] < exact[near] + 1e-3).sum()
        late += near.sum()
    assert good / late > 0.95


# --------------------------------------------------------------------------- what counts


def test_what_is_measured_again_is_not_counted_again(fingers, world):
    codes = world.encode(world.poses[:3])
    pose = se3.translation([0, 0, -0.04])
    (first,) = measured(fingers, other=touch(pose, codes[0]))
    assert first.tempering == 1.0
    count([first])
    assert measured(fingers, other=touch(pose, codes[1])) == []  # at rest
    (second,) = measured(fingers, MOVED, other=touch(pose, codes[1]))
    assert 0 < second.tempering < 0.3
    count([second])
    assert measured(fingers, MOVED, other=touch(pose, codes[1])) == []  # the same image
    fingers.force_update()
    assert measured(fingers, other=touch(pose, codes[1]))[0].tempering == 1.0
    fingers.restart()
    assert measured(fingers, other=touch(pose, codes[1]))[0].tempering == 1.0


def test_a_touch_counts_in_full_while_nothing_explains_its_maps(make_finger, gates, world):
    codes = world.encode(world.poses[:3])
    pose, penetration = se3.translation([0, 0, -0.04]), np.ones((160, 120), np.float32)
    fingers = Fingers(make_finger, penetration.shape, gates)
    count(measured(fingers, other=touch(pose, codes[0], penetration=penetration)))
    (unexplained,) = measured(fingers, MOVED, other=touch(pose, codes[1], penetration=penetration))
    assert unexplained.tempering == 1.0
    count([unexplained])
    (explained,) = measured(fingers, MOVED, explained={"other"}, other=touch(pose, codes[2], penetration=penetration))
    assert explained.tempering < 0.3
    count([explained])
    (code_only,) = measured(fingers, MOVED, other=touch(pose, codes[0]))
    assert code_only.tempering < 0.3


def test_touches_in_contact_and_in_the_air_are_counted_apart(fingers, world):
    """What was measured in the air says nothing about the patch that is touched next, and the other way round."""
    codes = world.encode(world.poses[:3])
    pose = se3.translation([0, 0, -0.04])
    count(measured(fingers, other=touch(pose, codes[0])))
    (free,) = measured(fingers, MOVED, other=touch(pose))
    assert free.tempering == 1.0
    free.count()
    (again,) = measured(fingers, MOVED, other=touch(pose))
    assert again.tempering < 0.3
    again.count()
    (landed,) = measured(fingers, MOVED, other=touch(pose, codes[1]))
    path = 3 * (2e-3 + 0.01 * 0.05)
    assert landed.tempering == pytest.approx(path / CONFIG.correlation_length, rel=0.05)


def test_a_finger_that_moves_alone_tells_something(fingers, world):
    codes = world.encode(world.poses[:2])
    pose = se3.translation([0, 0, -0.04])
    count(measured(fingers, other=touch(pose, codes[0])))
    (moved,) = measured(fingers, other=touch(pose @ MOVED, codes[1]))
    assert moved.tempering == pytest.approx((2e-3 + 0.01 * 0.05) / CONFIG.correlation_length, rel=1e-3)


@pytest.mark.parametrize(
    ("pose", "kind", "reason"),
    [
        (np.full((4, 4), np.nan), "bad_finger_pose", "finger left: pose is not finite"),
        (2 * np.eye(4), "bad_finger_pose", "finger left: pose is not a rigid transform"),
        (np.eye(3), "bad_finger_pose", "finger left: pose of shape"),
        (se3.translation([1e300, 0, 0]), "bad_finger_pose", "finger left: pose is 1e+300 m from"),
    ],
)
def test_finger_poses_that_are_none_are_refused(fingers, gates, world, pose, kind, reason):
    assert measured(fingers, left=touch(pose, world.codebook.codes[0])) == []
    assert gates.counts[kind] == 1
    assert gates.note.startswith(reason)


@pytest.mark.parametrize("code", [np.full(64, np.nan), np.zeros(64), np.ones(5)])
def test_codes_that_are_none_are_refused(fingers, gates, code):
    assert measured(fingers, left=touch(np.eye(4), code)) == []
    assert gates.counts["bad_code"] == 1
    assert gates.note.startswith("finger left: code")
