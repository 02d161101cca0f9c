from dataclasses import replace

import numpy as np
import pytest

from midastouch_benchmark.baselines.paper_filter import PaperConfig, PaperFilter
from midastouch_common import se3
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook

SMALL = PaperConfig(n_start=2000, n_least=200)


@pytest.fixture
def paper_filter(mesh, codebook):
    return PaperFilter(mesh, codebook, SMALL, threads=1)


@pytest.fixture(scope="module")
def slide(sequence, pose_codes):
    poses, measured = sequence.poses_true, sequence.poses_measured
    return poses, [*se3.odometry(measured)], [Measurement(True, code) for code in pose_codes(poses)]


def particle_error(one: PaperFilter, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((one.poses[:, :3, 3] - truth[:3, 3]) ** 2, axis=1))))


def run(one: PaperFilter, slide, seed: int) -> list:
    poses, odometry, touches = slide
    one.reset(seed)
    one.initialise_gaussian(poses[0], 0.02, np.radians(40))
    return [one.step(motion, touch) for motion, touch in zip(odometry, touches, strict=True)]


def test_it_says_nothing_before_a_start(paper_filter, slide):
    estimate = paper_filter.step(None, slide[2][0])
    assert estimate.pose is None
    assert estimate.status.state == "uninitialised"
    assert len(paper_filter.poses) == 0


def test_a_start_lies_on_codebook_poses(paper_filter, codebook):
    paper_filter.initialise_gaussian(codebook.poses[7], 0.02, 0.5)
    positions = paper_filter.poses[:, :3, 3]
    assert len(positions) == SMALL.n_start
    distance = np.abs(positions[:200, None] - codebook.poses[None, :, :3, 3]).max(axis=2).min(axis=1)
    assert distance.max() < 1e-6
    assert np.linalg.norm(positions - codebook.poses[7, :3, 3], axis=1).mean() < 0.06


def test_a_slide_narrows_the_particles_around_the_truth(paper_filter, slide):
    poses, _, touches = slide
    paper_filter.reset(0)
    paper_filter.initialise_gaussian(poses[0], 0.02, np.radians(40))
    before = particle_error(paper_filter, poses[0])
    estimates = run(paper_filter, slide, 0)
    assert particle_error(paper_filter, poses[-1]) < 0.7 * before
    assert min(np.linalg.norm(mode.pose[:3, 3] - poses[-1, :3, 3]) for mode in estimates[-1].modes) < before
    counts = [e.status.n_particles for e in estimates]
    assert SMALL.n_least <= min(counts) < SMALL.n_start
    assert len(touches) == len(estimates)


def test_the_same_seed_gives_the_same_particles(paper_filter, slide):
    slide = tuple(part[:8] for part in slide)
    first = run(paper_filter, slide, 3)[-1].pose, paper_filter.poses
    second = run(paper_filter, slide, 3)[-1].pose, paper_filter.poses
    assert (first[0] == second[0]).all()
    assert (first[1] == second[1]).all()
    assert (run(paper_filter, slide, 4)[-1].pose != first[0]).any()


@pytest.mark.parametrize("prune_distance", [1e-3, 2e-3])
def test_particles_off_the_surface_are_pruned(mesh, codebook, slide, prune_distance):
    config = replace(SMALL, noise_translation=3e-3, prune_distance=prune_distance)
    paper_filter = PaperFilter(mesh, codebook, config, threads=1)
    paper_filter.initialise_uniform()
    paper_filter.step(np.eye(4), slide[2][0])
    distance = mesh.closest_points(paper_filter.poses[:, :3, 3])[1]
    assert 0.8 * prune_distance < distance.max() < prune_distance + 5e-4
    assert len(paper_filter.poses) == SMALL.n_start


def test_when_all_are_off_the_surface_they_return_to_the_codebook(paper_filter, mesh, slide):
    paper_filter.initialise_uniform()
    away = np.eye(4)
    away[2, 3] = 0.05
    paper_filter.step(away, slide[2][0])
    assert len(paper_filter.poses) == SMALL.n_start
    assert mesh.closest_points(paper_filter.poses[:, :3, 3])[1].max() < 3e-3


def test_hypotheses_are_clusters_with_their_share_and_mean(mesh, codebook):
    rng = np.random.default_rng(2)
    ends = [codebook.poses[np.argmin(codebook.poses[:, 0, 3])], codebook.poses[np.argmax(codebook.poses[:, 0, 3])]]
    spread = [se3.exp(rng.normal(0, [2e-4] * 3 + [0.02] * 3, (n, 6))) for n in (300, 100)]
    poses = np.concatenate([end @ s for end, s in zip(ends, spread, strict=True)])
    # one code for all leaves the weights even
    codebook = Codebook(poses, np.ones((len(poses), 48), np.float32), codebook.meta)
    paper_filter = PaperFilter(mesh, codebook, replace(SMALL, n_start=len(poses)), threads=1)
    paper_filter.initialise_uniform()  # once at each pose
    estimate = paper_filter.step(None, Measurement(True, np.ones(48, np.float32)))
    assert [mode.n for mode in estimate.modes] == [300, 100]
    assert [mode.weight for mode in estimate.modes] == pytest.approx([0.75, 0.25])
    for mode, end in zip(estimate.modes, ends, strict=True):
        assert np.linalg.norm(mode.pose[:3, 3] - end[:3, 3]) < 1e-3
        assert np.degrees(se3.rotation_angle(mode.pose[:3, :3].T @ end[:3, :3])) < 2


def test_the_spread_of_the_hypotheses_sets_the_number_of_particles(mesh, codebook, slide):
    config = replace(SMALL, n_least=1000)
    paper_filter = PaperFilter(mesh, codebook, config, threads=1)

    def count(sigma: float) -> int:
        """Particles after one step from another start, whose spread is compared with that of the step before."""
        paper_filter.initialise_gaussian(codebook.poses[7], sigma, 0.1)
        return paper_filter.step(np.eye(4), slide[2][0]).status.n_particles

    assert count(0.008) == config.n_start
    assert config.n_least < count(0.005) < 0.85 * config.n_start
    assert count(0.012) == config.n_start
    assert count(1e-5) == config.n_least
    assert count(0.008) == config.n_start


def test_without_contact_it_goes_on_with_a_random_code(paper_filter, slide):
    run(paper_filter, tuple(part[:3] for part in slide), 0)
    estimate = paper_filter.step(slide[1][1], Measurement(False))
    assert estimate.status.state == "no_contact"
    assert np.isfinite(paper_filter.poses).all()
