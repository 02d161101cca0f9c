"""Numbers that nobody should give the filter, and more of them than anybody will: each ends in a defined state.

What lies closer to one module is tested there: codes, maps and poses that are refused in core/test_fingers.py, books
and meshes in core/test_object_model.py, transforms in transforms/test_buffer.py, stamps that repeat or run back in
test_timeline.py and nodes/test_transform_times.py.
"""

import contextlib
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from filter_runs import assert_defined, codes_along, error, play, some_book
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.touch import MAP_SCALE, Measurement
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import ObjectSymmetry

FRAME = 1 / 30  # s
AIR = Measurement(False)
MAP_SHAPE = (80, 60)
DIM = 64


@pytest.fixture(scope="module")
def filter_(world):
    """Of a small codebook, with maps."""
    book = some_book(world, world.mesh, 1000, sensor="digit_tacto")
    book.symmetry = ObjectSymmetry()
    return ParticleFilter(world.mesh, book, FilterConfig(threads=1))


@given(
    arrays(float, 3, elements=st.floats(-1e300, 1e300) | st.floats(-1, 1)),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
)
@settings(max_examples=25)
def test_absurd_priors_are_refused_and_all_others_are_a_start(filter_, world, where, sigma_t, sigma_r):
    filter_.reset(0)
    prior = se3.translation(where)
    if max(np.abs(where).max() / 2, sigma_t, sigma_r) > 1e3:
        with pytest.raises(InputError, match="prior pose"):
            filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        return
    with contextlib.suppress(InputError):  # just beyond the limit
        filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        touch = Measurement(True, world.encode(world.poses[:1])[0], penetration=np.full(MAP_SHAPE, 1e-4, np.float32))
        for _ in range(3):
            assert_defined(filter_, filter_.step(None, touch))


@pytest.mark.parametrize("dtype", [np.float64, np.float16])
def test_maps_of_any_precision_and_order_are_taken(mapped_slide, dtype):
    poses = []
    for spoil in (lambda each: each, lambda each: np.asfortranarray(each.astype(dtype))):
        filter_ = mapped_slide.make_filter()
        filter_.initialise_uniform()
        for motion, touch in zip(mapped_slide.odometry[:15], mapped_slide.touches, strict=False):
            estimate = filter_.step(motion, replace(touch, penetration=spoil(touch.penetration)))
        poses.append(estimate.pose)
    np.testing.assert_allclose(*poses, atol=1e-3)


def test_where_all_poses_weigh_the_same_it_says_so(world, mapped_slide):
    """Codes that are all the same, and maps in which nothing is touched."""
    book = world.make_codebook(world.poses, np.ones((8000, DIM), np.float32), world.codebook.derived)
    book.meta["sensor"], book.symmetry = "digit_tacto", ObjectSymmetry()
    filter_ = ParticleFilter(world.mesh, book, FilterConfig(threads=1))
    filter_.initialise_uniform()
    for motion in mapped_slide.odometry[:30]:
        touch = Measurement(True, np.ones(DIM), penetration=np.zeros(MAP_SHAPE, np.float32))
        estimate = filter_.step(motion, touch, elapsed=FRAME)
        assert_defined(filter_, estimate)
    assert estimate.status.state in (state.SEARCHING, state.LOST)
    assert np.sqrt(np.trace(estimate.covariance[:3, :3])) > 0.02


def test_with_one_hypothesis_left_anything_may_follow(mapped_slide):
    for nonsense in ("maps", "codes", "air", "jump"):
        filter_ = mapped_slide.make_filter()
        filter_.initialise_uniform()
        play(filter_, mapped_slide, slice(0, 80))
        assert len(filter_.belief) == 1
        rng = np.random.default_rng(0)
        for k in range(30):
            touch = mapped_slide.touches[k]
            motion = se3.exp(rng.normal(size=6) * np.repeat([0.6 if nonsense == "jump" else 3e-3, 0.1], 3))
            if nonsense == "maps":
                touch = replace(touch, penetration=np.abs(rng.normal(0, 1e-3, MAP_SHAPE)).astype(np.float32))
            elif nonsense == "codes":
                touch = replace(touch, code=rng.standard_normal(DIM))
            elif nonsense == "air" and k % 3:
                touch = AIR
            assert_defined(filter_, filter_.step(motion, touch, elapsed=FRAME))


@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e-20, 1e4])
@pytest.mark.parametrize("part", ["rotation", "all"])
def test_covariances_may_be_nearly_singular(mapped_slide, scale, part):
    filter_ = mapped_slide.make_filter()
    filter_.initialise_gaussian(mapped_slide.poses[0], 1e-3, 0.02)
    belief = filter_.belief
    covariance = scale * np.eye(6)
    if part == "rotation":
        covariance[:3, :3] = 1e-6 * np.ones((3, 3))
    belief.hypotheses = replace(belief.hypotheses, covariances=covariance[None])
    for k in range(12):
        assert_defined(filter_, play(filter_, mapped_slide, slice(k, k + 1)))


@pytest.mark.parametrize(
    "extremes",
    [
        {"drift_translation": 0.0, "drift_rotation": 0.0, "jitter_translation": 1e-6, "jitter_rotation": 1e-5},
        {"drift_translation": 0.1, "drift_rotation": 3.0, "jitter_translation": 0.05, "jitter_rotation": 1.0},
        {"penetration_noise": 1e-6, "penetration_correlation": 1e-4, "temperature": 1e-3},
        {"outlier": 0.9, "temperature": 10.0, "penetration_noise": 1e-2},
        {"max_particles": 100, "refined_modes": 1, "tested_poses": 1, "alignments_per_second": 1},
        pytest.param(
            {"alignments_per_second": 0, "keyframe_spacing": 1e-3, "refined_modes": 64}, marks=pytest.mark.slow
        ),
    ],
    ids=["sure of all", "sure of nothing", "sure of maps", "sure of no map", "hardly any work", "all the work"],
)
def test_any_settings_end_in_a_defined_state(mapped_slide, extremes):
    filter_ = mapped_slide.make_filter(**extremes)
    filter_.initialise_uniform()
    for k in range(12):
        assert_defined(filter_, play(filter_, mapped_slide, slice(k, k + 1), FRAME))
    filter_.step(se3.inverse(mapped_slide.poses[11]) @ mapped_slide.poses[0], AIR)
    assert_defined(filter_, play(filter_, mapped_slide, slice(0, 1), FRAME))


def run_on(mesh, world, step):
    """A filter after a slide of 40 steps over another mesh, and the truth."""
    rng = np.random.default_rng(0)
    book = some_book(world, mesh, 2000, sensor="digit_tacto")
    book.symmetry = ObjectSymmetry()
    filter_ = ParticleFilter(mesh, book, FilterConfig(threads=1))
    filter_.initialise_uniform()
    truth = world.make_slide(mesh, 40, rng, step)
    maps = np.maximum(PenetrationRenderer(mesh, SensorModel.load("digit_tacto").scaled(MAP_SCALE)).render(truth), 0)
    for motion, code, penetration in zip(se3.odometry(truth), world.encode(truth), maps, strict=True):
        estimate = filter_.step(motion, Measurement(True, code, penetration=penetration), elapsed=FRAME)
        assert_defined(filter_, estimate)
    return estimate, truth[-1]


@pytest.mark.parametrize("size", [0.01, 1.95])
def test_objects_of_a_centimetre_and_of_two_metres(world, size):
    low, high = world.mesh.bounds
    vertices = world.mesh.vertices * size / np.linalg.norm(high - low)
    estimate, truth = run_on(ObjectMesh.from_arrays(vertices, world.mesh.faces, "scaled"), world, 1.5e-3)
    if estimate.status.state == state.CONVERGED:
        assert error(estimate, truth)[0] < 5e-3


def slivers(kind):
    if kind == "blade":
        return trimesh.creation.box([0.1, 2e-4, 0.05])
    rod = trimesh.creation.cylinder(radius=0.01, height=0.2, sections=300)  # triangles of 0.2 mm x 200 mm
    if kind == "needle":
        rod.apply_scale([0.05, 0.05, 1.0])
    return rod


@pytest.mark.parametrize("kind", ["blade", "rod", "needle"])
def test_slivers(world, kind):
    shape = slivers(kind)
    run_on(ObjectMesh.from_arrays(shape.vertices, shape.faces, kind), world, 1e-3)


@pytest.mark.slow
def test_a_codebook_of_two_hundred_thousand_poses(world, mapped_slide):
    poses = world.random_poses(world.mesh, 200_000, np.random.default_rng(0))
    book = world.make_codebook(poses, world.encode(poses), world.of_surface)
    book.meta["sensor"], book.symmetry = "digit_tacto", ObjectSymmetry()
    filter_ = ParticleFilter(world.mesh, book, FilterConfig(threads=1, max_particles=200_000))
    filter_.initialise_uniform()
    estimate = play(filter_, mapped_slide, slice(0, 60), FRAME)
    assert_defined(filter_, estimate)
    assert error(estimate, mapped_slide.poses[59])[0] < 2e-3


def to_and_fro(slide):
    """Steps (motion, touch) from the last frame of a slide to the first one and back."""
    count = len(slide.poses)
    order = [*range(count - 2, -1, -1), *range(1, count)]
    before = [count - 1, *order[:-1]]
    motions = se3.inverse(slide.poses[before]) @ slide.poses[order]
    return list(zip(motions, [slide.touches[k] for k in order], strict=True))


@pytest.mark.slow
def test_a_hundred_thousand_steps(mapped_slide):
    """An arm that rests most of the time, and slides to and fro, lifts now and then, and errs like a real one."""
    filter_ = mapped_slide.make_filter()
    filter_.initialise_uniform()
    play(filter_, mapped_slide)
    rng, most = np.random.default_rng(0), 0
    lift, down = se3.translation([0, 0, 0.02]), se3.translation([0, 0, -0.02])
    resting = mapped_slide.touches[-1]
    for _ in range(25):
        errors = se3.exp(rng.normal(size=(238, 6)) * np.repeat([5e-5, 1e-3], 3))
        for (motion, touch), error_of_arm in zip(to_and_fro(mapped_slide), errors, strict=True):
            filter_.step(motion @ error_of_arm, touch, elapsed=FRAME)
            most = max(most, len(filter_.belief))
        for motion, touch in ((lift, AIR), (down, resting)):
            filter_.step(motion, touch, elapsed=FRAME)
        for _ in range(3760):
            estimate = filter_.step(np.eye(4), resting, elapsed=FRAME)
        assert_defined(filter_, estimate)
    assert most < 30_000
    assert len(filter_.measured_gels) < 1000
    assert error(estimate, mapped_slide.poses[-1])[0] < 3e-3
    assert estimate.status.state == state.CONVERGED, estimate.status.reason


@pytest.mark.parametrize("elapsed", [0.0, -5.0, 1e9, math.inf, 1e-9])
def test_any_time_between_frames_ends_in_a_defined_state(mapped_slide, elapsed):
    """That time runs backwards is the node's to notice."""
    filter_ = mapped_slide.make_filter()
    filter_.initialise_uniform()
    for k in range(15):
        assert_defined(filter_, play(filter_, mapped_slide, slice(k, k + 1), elapsed))


actions = st.lists(
    st.tuples(
        st.sampled_from(["slide", "rest", "nan", "jump", "spin", "lift", "small", None]),
        st.sampled_from(["touch", "nan", "zero", "short", "air", "random", "opposite", "blind", "deep"]),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=25)
@given(actions, st.integers(0, 1000))
def test_nothing_makes_it_say_something_that_is_no_number(filter_, world, mapped_slide, sequence, seed):
    rng = np.random.default_rng(seed)
    (_, code), (slid, _) = codes_along(world, 2)
    motions = {
        "slide": slid,
        "rest": np.eye(4),
        "nan": np.full((4, 4), np.nan),
        "jump": se3.exp([10, 0, 0, 0, 0, 0]),
        "spin": se3.exp([0, 0, 0, np.pi, 0, 0]),
        "lift": se3.exp([0, 0, 0.2, 0, 0, 0]),
        "small": se3.exp([1e-9] * 6),
        None: None,
    }
    touches = {
        "touch": code,
        "nan": np.full(64, np.nan),
        "zero": np.zeros(64),
        "short": np.ones(5),
        "air": None,
        "random": rng.standard_normal(64),
        "opposite": -code,
        "blind": code,
        "deep": code,
    }
    filter_.reset(seed)
    filter_.initialise_uniform()
    for motion, touch in sequence:
        penetration = None if touch == "blind" else mapped_slide.touches[0].penetration
        if touch == "deep":
            penetration = np.full(MAP_SHAPE, 1e30, np.float32)
        estimate = filter_.step(motions[motion], Measurement(touch != "air", touches[touch], penetration=penetration))
        assert_defined(filter_, estimate)


@given(
    arrays(float, 6, elements=st.floats(-1, 1)),
    arrays(float, 6, elements=st.floats(-1, 1)),
    st.sampled_from([1.0, 1e-2, 1e-4, 0.0]),
)
@settings(max_examples=100)
def test_float32_pose_distance_agrees_with_float64(world, at, step, size):
    """Also where almost equal poses make the scalar product lose its digits."""
    near = se3.exp(at * [0.3, 0.3, 0.3, 3, 3, 3])
    far = near @ se3.exp(size * step * [0.01, 0.01, 0.01, 1, 1, 1])
    lookup = PoseLookup(np.stack([near, near]), Workers(1))
    got = lookup.follow(Particles.from_poses(far[None], np.zeros(1, np.int32)))[0]
    between = se3.inverse(near) @ far
    exact = math.hypot(np.linalg.norm(between[:3, 3]), 0.02 * math.sin(se3.rotation_angle(between[:3, :3]) / 2))
    assert got == pytest.approx(exact, abs=1.5e-5)
