from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_filter.paper_filter import PaperConfig, PaperFilter
from midastouch_perception.codebook import Codebook
from midastouch_perception.symmetry.search import ObjectSymmetry

SMALL = PaperConfig(n_start=2000, n_least=500)


@pytest.fixture
def running(world):
    out = PaperFilter(world.mesh, world.codebook, SMALL, threads=1)
    out.initialise_uniform()
    return out


@pytest.fixture
def touches(world):
    return [Measurement(True, code) for code in world.encode(world.poses[:2])]


def test_what_it_does_not_know_changes_nothing(world, running, touches):
    other = PaperFilter(world.mesh, world.codebook, SMALL, threads=1)
    other.initialise_uniform()
    for touch in touches:
        expected = running.step(np.eye(4), touch)
        finger = Measurement(True, touch.code, T_gel_finger=se3.translation([0.05, 0.0, 0.0]))
        found = other.step(np.eye(4), touch, {"other": finger}, 0.03)
        other.force_update()
        other.deferred_update(lambda: False)
        np.testing.assert_array_equal(found.pose, expected.pose)
    assert other.modes == found.modes


@pytest.mark.parametrize("code", [np.zeros(64), np.ones(63), np.full(64, np.nan)])
def test_an_unusable_code_is_refused_before_anything_moves(running, touches, code):
    running.step(None, touches[0])
    before = running.poses
    with pytest.raises(InputError, match="64 finite numbers"):
        running.step(se3.translation([0.01, 0.0, 0.0]), Measurement(True, code.astype(np.float32)))
    np.testing.assert_array_equal(running.poses, before)


def test_codes_of_another_network_are_refused(running, touches):
    with pytest.raises(InputError, match="network other"):
        running.step(None, Measurement(True, touches[0].code, network_id="other"))


def test_the_limits_of_its_state_are_those_of_the_settings(world, touches):
    states = []
    for limits in (
        FilterConfig(),
        FilterConfig(converged_error=0.4, converged_rotation=3.0, converged_probability=0.5),
    ):
        running = PaperFilter(world.mesh, world.codebook, SMALL, threads=1, limits=limits)
        running.initialise_gaussian(world.poses[0], 0.003, 0.3)
        states.append(running.step(None, touches[0]).status.state)
    assert states[0] != states[1] == CONVERGED


def test_a_start_forgets_what_was_found_before(running, touches):
    running.step(None, touches[0])
    assert running.modes
    running.initialise_uniform()
    assert running.modes == []


def test_it_goes_on_by_a_denser_codebook(world, running, touches):
    running.step(None, touches[0])
    before = running.poses
    running.take(running.object.with_codebook(world.make_codebook(world.poses[:500], world.codebook.codes[:500])))
    np.testing.assert_array_equal(running.poses, before)
    assert running.object.density.startswith("codebook of 500 poses")
    assert running.step(None, touches[1]).modes


def test_it_knows_the_symmetry_that_the_codebook_tells(world):
    codebook = world.make_codebook(world.poses, world.codebook.codes)
    assert PaperFilter(world.mesh, codebook, SMALL).object.symmetry.exact.trivial
    codebook.symmetry = ObjectSymmetry(given=True)
    assert PaperFilter(world.mesh, codebook, SMALL).object.symmetry is codebook.symmetry


def run(one: PaperFilter, slide, seed: int, frames: int = 30) -> list:
    """Estimates along the first frames of a slide."""
    one.reset(seed)
    one.initialise_gaussian(slide.poses[0], 0.02, np.radians(40))
    return [one.step(*each) for each in list(zip(slide.odometry, slide.touches, strict=True))[:frames]]


def particle_error(one: PaperFilter, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((one.poses[:, :3, 3] - truth[:3, 3]) ** 2, axis=1))))


def test_it_gives_no_answer_before_a_start(world, touches):
    running = PaperFilter(world.mesh, world.codebook, SMALL, threads=1)
    estimate = running.step(None, touches[0])
    assert estimate.pose is None
    assert estimate.status.state == "uninitialised"
    assert len(running.poses) == 0


def test_a_start_lies_on_codebook_poses(world, running):
    running.initialise_gaussian(world.poses[7], 0.02, 0.5)
    positions = running.poses[:, :3, 3]
    assert len(positions) == SMALL.n_start
    distance = np.abs(positions[:200, None] - world.poses[None, :, :3, 3]).max(axis=2).min(axis=1)
    assert distance.max() < 1e-6
    assert np.linalg.norm(positions - world.poses[7, :3, 3], axis=1).mean() < 0.06


def test_a_slide_narrows_the_particles_around_the_truth(running, coded_slide):
    running.initialise_gaussian(coded_slide.poses[0], 0.02, np.radians(40))
    before = particle_error(running, coded_slide.poses[0])
    estimates = run(running, coded_slide, 0)
    truth = coded_slide.poses[len(estimates) - 1]
    assert particle_error(running, truth) < 0.7 * before
    assert min(np.linalg.norm(mode.pose[:3, 3] - truth[:3, 3]) for mode in estimates[-1].modes) < before
    assert SMALL.n_least <= min(each.status.n_particles for each in estimates) < SMALL.n_start


def test_the_same_seed_gives_the_same_particles(running, coded_slide):
    first = run(running, coded_slide, 3, 8)[-1].pose, running.poses
    second = run(running, coded_slide, 3, 8)[-1].pose, running.poses
    assert (first[0] == second[0]).all()
    assert (first[1] == second[1]).all()
    assert (run(running, coded_slide, 4, 8)[-1].pose != first[0]).any()


@pytest.mark.parametrize("prune_distance", [1e-3, 2e-3])
def test_particles_off_the_surface_are_pruned(world, touches, prune_distance):
    config = replace(SMALL, noise_translation=3e-3, prune_distance=prune_distance)
    running = PaperFilter(world.mesh, world.codebook, config, threads=1)
    running.initialise_uniform()
    running.step(np.eye(4), touches[0])
    distance = world.mesh.closest_points(running.poses[:, :3, 3])[1]
    assert 0.8 * prune_distance < distance.max() < prune_distance + 5e-4
    assert len(running.poses) == SMALL.n_start


def test_particles_all_off_the_surface_return_to_the_codebook(world, running, touches):
    running.step(se3.translation([0.0, 0.0, 0.2]), touches[0])
    assert len(running.poses) == SMALL.n_start
    assert world.mesh.closest_points(running.poses[:, :3, 3])[1].max() < 3e-3


def test_hypotheses_are_clusters_with_their_share_and_mean(world):
    rng = np.random.default_rng(2)
    ends = [world.poses[np.argmin(world.poses[:, 0, 3])], world.poses[np.argmax(world.poses[:, 0, 3])]]
    spread = [se3.exp(rng.normal(0, [2e-4] * 3 + [0.02] * 3, (n, 6))) for n in (300, 100)]
    poses = np.concatenate([end @ each for end, each in zip(ends, spread, strict=True)])
    # one code for all leaves the weights even
    codebook = Codebook(poses, np.ones((len(poses), 48), np.float32), world.codebook.meta)
    running = PaperFilter(world.mesh, codebook, replace(SMALL, n_start=len(poses), prune_distance=0.01), threads=1)
    running.initialise_uniform()  # once at each pose
    estimate = running.step(None, Measurement(True, np.ones(48, np.float32)))
    assert [mode.n for mode in estimate.modes] == [300, 100]
    assert [mode.weight for mode in estimate.modes] == pytest.approx([0.75, 0.25])
    for mode, end in zip(estimate.modes, ends, strict=True):
        assert np.linalg.norm(mode.pose[:3, 3] - end[:3, 3]) < 1e-3
        assert np.degrees(se3.rotation_angle(mode.pose[:3, :3].T @ end[:3, :3])) < 2


def test_without_contact_it_continues_with_a_random_code(running, coded_slide):
    run(running, coded_slide, 0, 3)
    estimate = running.step(coded_slide.odometry[3], Measurement(False))
    assert estimate.status.state == "no_contact"
    assert np.isfinite(running.poses).all()
