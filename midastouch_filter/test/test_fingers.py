"""Several fingers in one filter: properties of their likelihood, and a gripper that tells what one finger cannot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_filter import state
from midastouch_filter.config import FilterConfig
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.fingers import Finger, Fingers, count
from midastouch_filter.gates import Gates
from midastouch_filter.lookup import PoseLookup
from midastouch_filter.measurement_model import MeasurementModel
from midastouch_filter.motion_model import Odometry, transformed
from midastouch_filter.particles import Particles
from midastouch_filter.surface import SurfaceConstraint, SurfaceGrid
from midastouch_filter.touch import Measurement, reduced_penetration
from midastouch_filter.workers import Workers
from midastouch_perception import se3
from midastouch_perception.errors import InputError

CONFIG = FilterConfig(max_particles=3000, min_particles=300, threads=1, converged_translation=7e-3)
MOVED = se3.exp(np.array([2e-3, 0, 0, 0, 0, 0.05]))


@pytest.fixture(scope="module")
def parts(world):
    """lookup, surface, model, workers: what fingers are made of."""
    workers = Workers(1)
    lookup = PoseLookup(world.poses, workers)
    model = MeasurementModel(world.codebook.codes, world.codebook.meta, lookup, CONFIG, workers)
    grid = SurfaceGrid(world.mesh, CONFIG.dead_distance)
    surface = SurfaceConstraint(grid, lookup.largest_gap, CONFIG, workers)
    return lookup, surface, model, workers


@pytest.fixture
def gates():
    return Gates()


@pytest.fixture
def fingers(parts, gates):
    lookup, surface, model, workers = parts

    def make(name: str) -> Finger:
        return Finger(name, lookup, surface, model.for_another_sensor(), CONFIG, workers, gates)

    return Fingers(make, None, gates)


def felt(fingers, motion=None, **touches):
    """Those that feel something new after the first one moved by `motion` (4, 4)."""
    return fingers.feel(touches, None if motion is None else Odometry.from_matrix(motion))


def touch(T_gel_finger, code=None, **changes):
    return Measurement(code is not None, code, T_gel_finger=T_gel_finger, **changes)


@pytest.fixture(scope="module")
def cloud(parts, world):
    """Particles about poses of the book, as a filter has them."""
    lookup, *_ = parts
    rng = np.random.default_rng(7)
    poses = world.with_pose_noise(world.poses[rng.integers(0, 8000, 1500)], rng, 1e-3, 0.05)
    return Particles.from_poses(poses, lookup.exact(poses))


# --------------------------------------------------------------------------- likelihood of one further finger


def test_where_the_reference_is_a_finger_weighs_like_it(fingers, parts, cloud, world):
    lookup, surface, model, _ = parts
    code = world.encode(world.poses[:1])[0]
    (evidence,) = felt(fingers, twin=touch(np.eye(4), code))
    distance = lookup.follow(cloud)
    model.score_codebook(code)
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
        (evidence,) = felt(fingers, other=touch(se3.inverse(gels[0]) @ gels[1], code))
        right += evidence.log_ratio(particles, None).argmax() == 0
    assert right >= 18


def test_far_from_the_surface_nothing_is_proven(fingers, cloud, world):
    code = world.encode(world.poses[:1])[0]
    (evidence,) = felt(fingers, other=touch(se3.make(np.eye(3), np.array([0, 0, 0.5])), code))
    log_ratio = evidence.log_ratio(cloud, None)
    assert np.isfinite(log_ratio).all()
    assert (log_ratio <= math.log(0.05)).all()


def test_a_finger_that_touches_nothing_is_only_kept_out_of_the_object(fingers, parts, cloud):
    inside, outside, aside = (se3.make(np.eye(3), np.array([0, 0, z])) for z in (-5e-3, 5e-3, 0.3))
    weights = []
    for place in (inside, outside, aside):
        fingers.restart()
        (evidence,) = felt(fingers, other=touch(place))
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
    start = world.with_pose_noise(np.repeat(slides[0][:1], 1000, axis=0), rng, 5e-3, 0.2)
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
        (evidence,) = felt(fingers, MOVED, other=touch(T_gel_finger, world.encode(slides[1][k : k + 1])[0]))
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


def test_what_is_felt_again_is_not_counted_again(fingers, world):
    codes = world.encode(world.poses[:3])
    place = se3.make(np.eye(3), np.array([0, 0, -0.04]))
    (first,) = felt(fingers, other=touch(place, codes[0]))
    assert first.tempering == 1.0
    count([first])
    assert felt(fingers, other=touch(place, codes[1])) == []  # at rest
    (second,) = felt(fingers, MOVED, other=touch(place, codes[1]))
    assert 0 < second.tempering < 0.3
    count([second])
    assert felt(fingers, MOVED, other=touch(place, codes[1])) == []  # the same image
    fingers.force_update()
    assert felt(fingers, other=touch(place, codes[1]))[0].tempering == 1.0
    fingers.restart()
    assert felt(fingers, other=touch(place, codes[1]))[0].tempering == 1.0


def test_touches_in_contact_and_in_the_air_are_counted_apart(fingers, world):
    """What was felt in the air says nothing about the patch that is touched next, and the other way round."""
    codes = world.encode(world.poses[:3])
    place = se3.make(np.eye(3), np.array([0, 0, -0.04]))
    count(felt(fingers, other=touch(place, codes[0])))
    (free,) = felt(fingers, MOVED, other=touch(place))
    assert free.tempering == 1.0
    free.count()
    (again,) = felt(fingers, MOVED, other=touch(place))
    assert again.tempering < 0.3
    again.count()
    (landed,) = felt(fingers, MOVED, other=touch(place, codes[1]))
    path = 3 * (2e-3 + 0.01 * 0.05)
    assert landed.tempering == pytest.approx(path / CONFIG.correlation_length, rel=0.05)


def test_a_finger_that_moves_alone_tells_something(fingers, world):
    codes = world.encode(world.poses[:2])
    place = se3.make(np.eye(3), np.array([0, 0, -0.04]))
    count(felt(fingers, other=touch(place, codes[0])))
    (moved,) = felt(fingers, other=touch(place @ MOVED, codes[1]))
    assert moved.tempering == pytest.approx((2e-3 + 0.01 * 0.05) / CONFIG.correlation_length, rel=1e-3)


@pytest.mark.parametrize(
    ("place", "kind", "reason"),
    [
        (np.full((4, 4), np.nan), "bad_finger_pose", "finger left: pose is not finite"),
        (2 * np.eye(4), "bad_finger_pose", "finger left: pose is not a rigid transform"),
        (np.eye(3), "bad_finger_pose", "finger left: pose of shape"),
        (se3.make(np.eye(3), np.array([1e300, 0, 0])), "bad_finger_pose", "finger left: pose is 1e+300 m from"),
    ],
)
def test_finger_poses_that_are_none_are_refused(fingers, gates, world, place, kind, reason):
    assert felt(fingers, left=touch(place, world.codebook.codes[0])) == []
    assert gates.counts[kind] == 1
    assert gates.note.startswith(reason)


@pytest.mark.parametrize("code", [np.full(64, np.nan), np.zeros(64), np.ones(5)])
def test_codes_that_are_none_are_refused(fingers, gates, code):
    assert felt(fingers, left=touch(np.eye(4), code)) == []
    assert gates.counts["bad_code"] == 1
    assert gates.note.startswith("finger left: code")


# --------------------------------------------------------------------------- in the filter


@pytest.fixture(scope="module")
def pair(world):
    """Odometry, touches and finger poses of two slides over the world's object."""
    rng = np.random.default_rng(21)
    a, b = (world.make_slide(world.mesh, 40, rng) for _ in range(2))
    odometry = world.odometry_of(world.with_pose_noise(a, rng, 5e-4, math.radians(1.0)))
    touches = [Measurement(True, code) for code in world.encode(a)]
    return a, odometry, touches, [touch(p, code) for p, code in zip(se3.inverse(a) @ b, world.encode(b), strict=True)]


@pytest.fixture(scope="module")
def filter_(world):
    return ParticleFilter(world.mesh, world.codebook, CONFIG, 0)


def run(filter_, pair, others, touches=None, frames=40):
    """The last estimate, and all bits of what the filter believed; `others`: frame -> fingers."""
    filter_.reset(3)
    filter_.initialise_uniform()
    bits = b""
    for k in range(frames):
        estimate = filter_.step(pair[1][k], (touches or pair[2])[k], others(k))
        bits += filter_.poses.tobytes() + filter_.weights.tobytes()
    return estimate, bits


def test_order_and_absence_of_fingers_change_nothing(filter_, pair):
    third = touch(se3.make(np.eye(3), np.array([0, 0, 0.05])))
    one_way = run(filter_, pair, lambda k: {"a": pair[3][k], "b": third}, frames=10)[1]
    assert one_way == run(filter_, pair, lambda k: {"a": pair[3][k], "b": third}, frames=10)[1]
    assert one_way == run(filter_, pair, lambda k: {"b": third, "a": pair[3][k]}, frames=10)[1]
    alone = run(filter_, pair, lambda k: None, frames=10)[1]
    assert alone == run(filter_, pair, lambda k: {}, frames=10)[1]
    assert alone != one_way


def test_a_free_finger_far_from_the_object_changes_nothing(filter_, pair):
    aside = touch(se3.make(np.eye(3), np.array([0, 0, 0.4])))
    belief = [run(filter_, pair, lambda k, o=o: o, frames=10)[0] for o in ({}, {"free": aside})]
    np.testing.assert_allclose(belief[0].pose, belief[1].pose, atol=1e-9)


def test_refused_fingers_change_nothing_but_the_count(filter_, pair):
    bad = {"nan": touch(np.eye(4), np.full(64, np.nan)), "warped": touch(2 * np.eye(4), np.ones(64))}
    alone, refused = run(filter_, pair, lambda k: {}, frames=8), run(filter_, pair, lambda k: bad, frames=8)
    assert refused[1] == alone[1]
    assert (refused[0].status.skipped["bad_code"], refused[0].status.skipped["bad_finger_pose"]) == (8, 8)
    assert "finger" in refused[0].status.reason


PLACES = {
    "here": np.eye(4),
    "opposite": se3.exp(np.array([0, 0, -0.05, np.pi, 0, 0])),
    "far": se3.make(np.eye(3), np.array([9.0, 0, 0])),
    "absurd": se3.make(np.eye(3), np.array([1e30, 0, 0])),
    "warped": 2 * np.eye(4),
    "nan": np.full((4, 4), np.nan),
}


@settings(max_examples=25)
@given(st.lists(st.tuples(st.sampled_from(sorted(PLACES)), st.integers(0, 5), st.booleans()), min_size=1, max_size=12))
def test_whatever_fingers_feel_the_belief_stays_finite(filter_, pair, frames):
    codes = [pair[3][0].code, np.zeros(64), np.full(64, np.inf), np.ones(3), None, -np.ones(64)]
    filter_.initialise_uniform()
    for k, (place, code, reference) in enumerate(frames):
        others = {
            "a": Measurement(code != 4, codes[code], penetration=np.ones(3), T_gel_finger=PLACES[place]),
            "b": pair[3][k],
        }
        estimate = filter_.step(pair[1][k], pair[2][k] if reference else Measurement(False), others)
        assert np.isfinite(filter_.poses).all()
        assert np.isfinite(estimate.covariance).all()
        assert filter_.weights.sum() == pytest.approx(1)
        assert math.isfinite(estimate.status.likelihood_trend)
        assert estimate.status.state in state.STATES


def test_codes_of_another_network_are_named(filter_, world):
    filter_.initialise_uniform()
    with pytest.raises(InputError, match=r"other-net.*fourier-test"):
        filter_.step(None, Measurement(False), {"a": touch(np.eye(4), np.ones(64), network_id="other-net")})


def test_two_fingers_tell_more_at_the_first_touch(filter_, pair):
    truth, *_ = pair
    right = []
    for others in (lambda k: {}, lambda k: {"other": pair[3][k]}):
        run(filter_, pair, others, frames=1)
        near = np.linalg.norm(filter_.poses[:, :3, 3] - truth[0][:3, 3], axis=1) < 8e-3
        right.append(filter_.weights[near].sum())
    assert right[1] > right[0] + 0.1


def test_another_finger_counts_while_the_reference_is_in_the_air(filter_, pair):
    air = [Measurement(False)] * 40
    start = pair[0][0] @ se3.exp(np.array([4e-3, -4e-3, 0, 0, 0, 0.1]))
    errors = np.empty((2, 4))
    for case, others in enumerate((lambda k: {}, lambda k: {"other": pair[3][k]})):
        for seed in range(4):
            filter_.reset(seed)
            filter_.initialise_gaussian(start, 6e-3, 0.15)
            for k in range(40):
                estimate = filter_.step(pair[1][k], air[k], others(k))
            errors[case, seed] = np.linalg.norm(estimate.pose[:3, 3] - pair[0][-1][:3, 3])
            assert not case or estimate.status.state in (state.AMBIGUOUS, state.CONVERGED)
    assert errors[1].max() < 5e-3
    assert errors[1].mean() < 0.8 * errors[0].mean()


def test_the_reference_in_the_air_is_not_inside_the_object(filter_, pair, parts):
    """An arm that errs moves all particles into the object; those that are least so are believed more."""
    into = se3.make(np.eye(3), np.array([0, 0, -3e-3]))
    depths = []
    for reference in (Measurement(False), Measurement(True, np.full(64, np.nan))):
        filter_.reset(0)
        filter_.initialise_gaussian(pair[0][0], 4e-3, 0.02)
        filter_.step(into, reference, {"other": pair[3][0]})
        gels = Particles.from_poses(filter_.poses, np.zeros(len(filter_.poses), int))
        depths.append(-(filter_.weights @ parts[1].distance(gels)))
    assert depths[0] < depths[1] - 2e-4


def test_a_finger_needs_a_name(filter_):
    with pytest.raises(InputError, match="needs a name"):
        filter_.step(None, Measurement(False), {"": touch(np.eye(4))})


# --------------------------------------------------------------------------- a gripper


@pytest.mark.slow
@pytest.mark.parametrize("two", [False, True])
def test_two_fingers_tell_what_one_cannot(gripper, two):
    filter_, truth = gripper.make_filter(CONFIG), gripper.above
    filter_.reset(1)
    filter_.initialise_uniform()
    for k, motion in enumerate(gripper.odometry):
        above, below = (
            Measurement(True, codes[k], penetration=reduced_penetration(maps[k]))
            for codes, maps in zip(gripper.codes, gripper.penetrations, strict=True)
        )
        others = {"below": replace(below, T_gel_finger=gripper.between[k])} if two else {}
        estimate = filter_.step(motion, above, others)
    distances = [
        min(np.linalg.norm(mode.pose[:3, 3] - place[:3, 3]) for mode in estimate.modes)
        for place in (truth[-1], gripper.half_turn @ truth[-1])
    ]
    if two:
        assert estimate.status.state == state.CONVERGED, estimate.status.reason
        assert np.linalg.norm(estimate.pose[:3, 3] - truth[-1][:3, 3]) < 1e-3
        assert estimate.modes[0].weight > 0.95
    else:
        assert estimate.status.state == state.AMBIGUOUS, estimate.status.reason
        assert max(distances) < 3e-3
        assert estimate.modes[0].weight < 0.9


@pytest.mark.slow
def test_a_finger_explores_while_the_first_one_rests(gripper):
    """As a thumb that holds the object; the first finger's one touch fits two places."""
    filter_, truth = gripper.make_filter(CONFIG), gripper.above[0]
    resting = Measurement(True, gripper.codes[0][0], penetration=reduced_penetration(gripper.penetrations[0][0]))
    below = gripper.above @ gripper.between
    errors = []
    for seed in range(3):
        filter_.reset(seed)
        filter_.initialise_uniform()
        for k, gel in enumerate(below):
            exploring = Measurement(
                True, gripper.codes[1][k], penetration=reduced_penetration(gripper.penetrations[1][k])
            )
            others = {"below": replace(exploring, T_gel_finger=se3.inverse(truth) @ gel)}
            estimate = filter_.step(np.eye(4) if k else None, resting, others)
        assert estimate.status.state == state.CONVERGED, estimate.status.reason
        errors.append(np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]))
    assert np.median(errors) < 1e-3
    assert max(errors) < 5e-3


def test_a_penetration_map_that_is_none_costs_only_itself(gripper):
    filter_ = gripper.make_filter(CONFIG)
    filter_.reset(0)
    filter_.initialise_uniform()
    broken = Measurement(True, gripper.codes[1][0], penetration=np.full((80, 60), np.nan, np.float32))
    estimate = filter_.step(None, Measurement(False), {"below": replace(broken, T_gel_finger=gripper.between[0])})
    assert estimate.status.skipped["bad_relief"] == 1
    assert "finger below: penetration" in estimate.status.reason
    assert estimate.status.state == state.AMBIGUOUS
