"""Numbers, books and meshes that nobody should give the filter: each ends in a defined state with a reason.

What lies closer to one module is tested there: weights in test_resampling.py, bad codes and odometry one by one in
test_filter.py, transforms in test_transforms.py, stamps that repeat or run back in nodes/test_time_jumps.py.
"""

import contextlib
import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from midastouch_filter import state
from midastouch_filter.config import FilterConfig
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.gates import Gates, RestGate
from midastouch_filter.lookup import PoseLookup
from midastouch_filter.motion_model import MotionModel, Odometry
from midastouch_filter.particles import Particles
from midastouch_filter.surface import SurfaceConstraint
from midastouch_filter.touch import Measurement
from midastouch_filter.workers import Workers
from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

SMALL = FilterConfig(max_particles=300, min_particles=50, threads=1)
DIM = 64


def assert_defined(filter_, estimate):
    """Every number is finite, and the state has a reason."""
    status = estimate.status
    assert status.state in state.STATES
    assert status.reason
    numbers = [status.ess, status.mode_mass, status.spread_t, status.spread_r, status.likelihood_trend]
    assert np.isfinite(numbers).all()
    assert estimate.modes
    for mode in estimate.modes:
        assert math.isfinite(mode.weight)
        assert np.isfinite(mode.covariance).all()
        assert_rigid(mode.pose)
    assert_rigid(filter_.poses)
    assert np.isfinite(filter_.weights).all()
    assert filter_.weights.sum() == pytest.approx(1)


def assert_rigid(poses):
    rotation = poses[..., :3, :3]
    assert np.isfinite(poses).all()
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, -1, -2), np.broadcast_to(np.eye(3), rotation.shape), atol=1e-9
    )
    assert (np.linalg.det(rotation) > 0).all()


def some_book(world, mesh, n=300, **changes):
    """A codebook of random contact poses on any mesh."""
    poses = world.random_poses(mesh, n, np.random.default_rng(2))
    book = world.make_codebook(poses, world.encode(poses), world.of_surface if mesh is world.mesh else None)
    book.meta = {**book.meta, **changes}
    return book


@pytest.fixture(scope="module")
def filter_(world):
    """With refinement, so that penetrations are looked at, too."""
    book = some_book(world, world.mesh, 1000, sensor="digit_tacto")
    return ParticleFilter(world.mesh, book, SMALL, 0)


def slide(world, n, seed=3):
    truth = world.make_slide(world.mesh, n, np.random.default_rng(seed))
    return list(zip(world.odometry_of(truth), world.encode(truth), strict=True))


# --------------------------------------------------------------------------- rotations and motion

half_turns = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


@given(half_turns)
@settings(max_examples=100)
def test_half_turns_about_any_axis_are_motions(axis):
    axis /= np.linalg.norm(axis)
    turn = se3.make(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3))
    odometry = Odometry.from_matrix(turn)
    assert odometry.angle == pytest.approx(np.pi, abs=1e-6)
    particles = Particles.from_poses(turn[None], np.zeros(1, np.int32))
    still = FilterConfig(noise_translation=0.0, noise_rotation=0.0, noise_per_metre=0.0, noise_per_radian=0.0)
    MotionModel(still, np.random.default_rng(0), Workers(1)).propagate(particles, odometry, 1.0)
    np.testing.assert_allclose(particles.poses[0], np.eye(4), atol=1e-6)


def test_modes_of_particles_a_half_turn_apart_are_rotations(filter_, world):
    filter_.reset(0)
    filter_.initialise_gaussian(world.poses[0], 0.0, 10.0)
    for axis in np.eye(3):
        turn = se3.make(2 * np.outer(axis, axis) - np.eye(3), np.zeros(3))
        assert_defined(filter_, filter_.step(turn, Measurement(False)))


@given(st.floats(-4.9e-4, 4.9e-4), st.integers(2, 30))
@settings(max_examples=20)
def test_rest_adds_up_rotations_that_are_not_quite_orthonormal(stretch, steps):
    """Each is within tolerance; their product would not be."""
    gates = Gates()
    gate = RestGate(FilterConfig(), gates)
    step = np.eye(4)
    step[:3, :3] *= 1 + stretch
    for _ in range(steps):
        assert gate.motion(Odometry.from_matrix(step)) is None
    assert gates.counts["at_rest"] == steps


@given(
    arrays(float, 3, elements=st.floats(-1e300, 1e300) | st.floats(-1, 1)),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
    st.floats(0, allow_infinity=False) | st.floats(0, 1),
)
@settings(max_examples=40)
def test_absurd_priors_are_refused_and_wide_ones_start_on_the_object(filter_, world, where, sigma_t, sigma_r):
    filter_.reset(0)
    prior = se3.make(np.eye(3), where)
    if max(np.abs(where).max() / 2, sigma_t, sigma_r) > 1e3:
        with pytest.raises(InputError, match="prior pose"):
            filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        return
    with contextlib.suppress(InputError):  # just beyond the limit
        filter_.initialise_gaussian(prior, sigma_t, sigma_r)
        assert world.mesh.closest_points(filter_.poses[:, :3, 3])[1].max() < 0.02
        assert_defined(filter_, filter_.step(None, Measurement(True, world.encode(world.poses[:1])[0])))


# --------------------------------------------------------------------------- weights

tops = st.sampled_from([-np.inf, np.inf, np.nan, -1e300, -1e30, 0.0])


@given(tops, tops, st.integers(0, 300))
@settings(max_examples=30)
def test_any_weights_end_in_a_defined_state(filter_, world, most, some, count):
    """All equal, all impossible, all but a few impossible, or no numbers at all."""
    (motion, code), (second_motion, second) = slide(world, 2)
    filter_.reset(1)
    filter_.initialise_uniform()
    filter_.step(motion, Measurement(True, code))

    def log_weight(_, particles, codebook_distance):
        out = np.full(len(particles), most)
        out[:count] = some
        return out

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SurfaceConstraint, "log_weight", log_weight)
        estimate = filter_.step(second_motion, Measurement(True, second))
    assert_defined(filter_, estimate)
    usable = np.isfinite(most) if count == 0 else np.isfinite(some) or (count < 300 and np.isfinite(most))
    if not usable:
        assert estimate.status.state == state.LOST
        assert "started again" in estimate.status.reason


@pytest.mark.slow
def test_a_million_particles(world):
    book = some_book(world, world.mesh, 1000)
    many = ParticleFilter(world.mesh, book, FilterConfig(max_particles=1_000_000, threads=1), 0)
    many.initialise_uniform()
    for motion, code in slide(world, 2):
        estimate = many.step(motion, Measurement(True, code))
    assert estimate.status.n_particles >= 500
    for mode in estimate.modes:
        assert_rigid(mode.pose)
    assert many.weights.sum() == pytest.approx(1)


# --------------------------------------------------------------------------- codes and penetrations


@given(arrays(np.float64, DIM, elements=st.floats(width=64)), st.integers(0, 5))
@settings(max_examples=50)
def test_any_code_ends_in_a_defined_state(filter_, world, code, spoilt):
    (motion, good), (second_motion, _) = slide(world, 2)
    filter_.reset(0)
    filter_.initialise_uniform()
    filter_.step(motion, Measurement(True, good))
    code[: 10 * spoilt] = 0
    estimate = filter_.step(second_motion, Measurement(True, code))
    assert_defined(filter_, estimate)
    with np.errstate(over="ignore"):
        if not np.isfinite(code.astype(np.float32)).all():
            assert "not finite" in estimate.status.reason


MAP_SHAPE = (80, 60)


@pytest.mark.parametrize(
    "penetration",
    [
        np.full(MAP_SHAPE, np.nan, np.float32),
        np.full(MAP_SHAPE, np.inf, np.float32),
        np.full(MAP_SHAPE, 1e30, np.float32),
        np.zeros(MAP_SHAPE, np.float32),
        np.full((160, 120), 1e-3, np.float32),
        np.zeros((0, 0), np.float32),
    ],
    ids=["nan", "inf", "huge", "zero", "wrong size", "empty"],
)
def test_any_penetration_map_ends_in_a_defined_state(filter_, world, penetration):
    frames = slide(world, 3)
    truth = world.make_slide(world.mesh, 3, np.random.default_rng(3))
    filter_.reset(0)
    filter_.initialise_gaussian(truth[0], 5e-4, 0.02)
    for motion, code in frames:
        estimate = filter_.step(motion, Measurement(True, code, penetration=penetration))
        assert_defined(filter_, estimate)
    unusable = penetration.shape != MAP_SHAPE or not np.isfinite(penetration).all()
    assert (estimate.status.skipped.get("bad_relief", 0) == 3) == unusable
    assert ("penetration" in estimate.status.reason) == unusable


# --------------------------------------------------------------------------- float32


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


@pytest.mark.slow
def test_float32_particles_agree_with_float64_over_a_slide(filter_, world):
    """The whole chain of float32 moves against the same in matrices, without noise."""
    still = FilterConfig(
        noise_translation=0.0, noise_rotation=0.0, noise_per_metre=0.0, noise_per_radian=0.0, max_particles=200,
        min_particles=200, recovery=False, refinement=False, threads=1,
    )  # fmt: skip
    chain = ParticleFilter(world.mesh, some_book(world, world.mesh), still, 0)
    chain.initialise_uniform()
    expected = chain.poses
    for motion, _ in slide(world, 200):
        chain.step(motion, Measurement(False))
        if motion is not None:
            expected = expected @ motion
    off = se3.log(se3.inverse(expected) @ chain.poses)
    assert np.abs(off[:, :3]).max() < 1e-5
    assert np.abs(off[:, 3:]).max() < 1e-4


# --------------------------------------------------------------------------- meshes


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
    penetration = np.full(MAP_SHAPE, 1e-4, np.float32)
    step = se3.exp([5e-4, 0, 0, 0, 0, 0.01])
    for k in range(4):
        estimate = filter_.step(step, Measurement(True, book.codes[k], penetration=penetration))
        assert_defined(filter_, estimate)


@pytest.mark.parametrize(
    ("vertices", "faces", "said"),
    [
        (np.eye(3), np.array([[0, 1, 3]]), "vertex 3"),
        (np.eye(3), np.array([[0, 1, -1]]), "vertex -1"),
        (np.eye(3), np.array([[0, 1, 2, 0]]), "triangles"),
        (np.eye(4), np.array([[0, 1, 2]]), "triangles"),
        (np.empty((0, 3)), np.empty((0, 3), int), "without faces"),
        (1000 * np.eye(3), np.array([[0, 1, 2]]), "millimetres"),
    ],
)
def test_unusable_meshes_are_named(vertices, faces, said):
    with pytest.raises(InputError, match=f"thing: .*{said}"):
        ObjectMesh.from_arrays(vertices, faces, "thing")


@pytest.mark.slow
def test_a_book_in_millimetres_is_lost_with_a_reason(world):
    poses = world.random_poses(world.mesh, 300, np.random.default_rng(2))
    codes = world.encode(poses)
    poses[:, :3, 3] *= 1000
    filter_ = ParticleFilter(world.mesh, world.make_codebook(poses, codes), SMALL, 0)
    filter_.initialise_uniform()
    for motion, code in slide(world, 3):
        estimate = filter_.step(motion, Measurement(True, code))
        assert_defined(filter_, estimate)
    assert estimate.status.state == state.LOST


# --------------------------------------------------------------------------- codebooks


@pytest.mark.slow
def test_a_book_that_holds_every_pose_twice_works(world):
    poses = np.repeat(world.random_poses(world.mesh, 200, np.random.default_rng(2)), 2, axis=0)
    filter_ = ParticleFilter(world.mesh, world.make_codebook(poses, world.encode(poses)), SMALL, 0)
    filter_.initialise_uniform()
    for motion, code in slide(world, 4):
        assert_defined(filter_, filter_.step(motion, Measurement(True, code)))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p, c: (p, c[:-1]), "299 codes.*300 poses"),
        (lambda p, c: (p[:-1], c), "300 codes.*299 poses"),
        (lambda p, c: (p, c.ravel()), r"codes of shape \(19200,\)"),
        (lambda p, c: (p, np.empty((300, 0))), r"codes of shape \(300, 0\)"),
        (lambda p, c: (p, np.where(c > 0, np.nan, c)), "codes are not finite"),
        (lambda p, c: (np.where(p == 1, np.nan, p), c), "poses are not finite"),
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
    with pytest.raises(InputError, match="not a calibration"):
        ParticleFilter(world.mesh, book, SMALL, 0)
    for unusable in (np.nan, np.inf, -1.0, "warm"):
        book.meta[key] = unusable
        with pytest.raises(InputError, match="calibration"):
            ParticleFilter(world.mesh, book, SMALL, 0)


def test_penetration_maps_have_the_size_of_the_sensors_views():
    assert SensorModel.load("digit_tacto").scaled(0.25).gel_depth.shape == MAP_SHAPE
