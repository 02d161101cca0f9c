"""The exhaustive posterior on small bumpy objects, by rendered maps and codes that follow from the pose."""

import copy
from pathlib import Path

import numpy as np
import pytest
import trimesh

from midastouch_benchmark.trials.disturbances import Scene, kidnap
from midastouch_benchmark.trials.ideal_observer import KNOWN, Hypotheses, IdealObserver, observe
from midastouch_benchmark.trials.observed_slides import judged
from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.pose_hypothesis import Prior
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_perception.codebook import Codebook, codebook_poses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.finger import SimulatedFinger
from midastouch_perception.symmetry.group import Symmetry, about
from midastouch_perception.symmetry.search import ObjectSymmetry

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
SENSOR = SensorModel.load("digit_tacto")
HALF_TURNS = np.stack([np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])])
OF_A_BOX = Symmetry(about(np.zeros(3), HALF_TURNS))
STEP = 3e-3


def bumpy(turns: np.ndarray) -> ObjectMesh:
    """An ellipsoid of some 50 x 38 x 30 mm with bumps at uneven places, the same after each of the turns (K, 3, 3)."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    directions = np.random.default_rng(3).standard_normal((12 // len(turns), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    every = np.concatenate([directions @ turn for turn in turns])
    bumps = np.exp(15 * (sphere.vertices @ every.T - 1)).sum(axis=1)
    vertices = sphere.vertices * (1 + 0.15 * bumps[:, None]) * [0.025, 0.019, 0.015]
    loaded = ObjectMesh.from_arrays(vertices, sphere.faces, "bumpy")
    loaded.path = Path("bumpy.ply")
    return loaded


class World:
    """An object, what its codebook tells of its symmetry, and what is measured on it."""

    def __init__(self, mesh: ObjectMesh, symmetry: Symmetry, encode):
        self.mesh, self.encode = mesh, encode
        poses = codebook_poses(mesh, 1600, SENSOR, np.random.default_rng(0))
        told = ObjectSymmetry(exact=symmetry, near=symmetry).as_json()
        meta = {"sensor": "digit_tacto", "temperature": 0.1, "outlier": 0.05, "symmetry": told}
        self.model = ObjectModel(mesh, Codebook(poses, encode(poses), meta), CONFIG, NOISE, Workers(1))
        self.yardstick = Yardstick.of(mesh, symmetry)

    def frames(self, poses: np.ndarray, seed: int = 0) -> list[TrialFrame]:
        """Touched there, as an arm with its errors reports it; maps with noise."""
        rng = np.random.default_rng(seed)
        measured = poses @ se3.exp(rng.standard_normal((len(poses), 6)) * ([2e-4] * 3 + [5e-3] * 3))
        maps = np.asarray(self.model.alignment.render(poses), np.float32)
        maps[maps > 0] += (2e-5 * rng.standard_normal((maps > 0).sum())).astype(np.float32)
        touches = [Measurement(True, c, 1e-4, "", m) for c, m in zip(self.encode(poses), maps, strict=True)]
        return [
            TrialFrame(k, *each, seconds=0.1)
            for k, each in enumerate(zip(touches, [{}] * len(poses), measured, poses, strict=True))
        ]

    def slide(self, headings: list[float], length: float, seed: int) -> np.ndarray:
        """Poses of a finger that slides in several directions."""
        finger = SimulatedFinger(self.mesh, SENSOR, np.random.default_rng(seed), STEP)
        list(finger.touch(0.02, np.array([0.0, 0.0, -1.0])))
        return np.array([finger.pose] + [pose for each in headings for pose in finger.slide(each, length)])

    def observe(self, frames: list[TrialFrame], *args, **kwargs):
        """Rows of the report, and the posteriors."""
        observed = list(observe(IdealObserver(self.model, NOISE, self.yardstick, *args, **kwargs), frames))
        return judged(observed, frames, self.yardstick), [posterior for _, posterior in observed]


HEADINGS = [0.3, 1.8, 3.5]


@pytest.fixture(scope="module")
def uneven(pose_codes):
    """Without any symmetry."""
    return World(bumpy(HALF_TURNS[:1]), Symmetry(), pose_codes)


@pytest.fixture(scope="module")
def folded(pose_codes):
    """Alike after half turns, as its codebook says."""
    return World(bumpy(HALF_TURNS), OF_A_BOX, pose_codes)


def test_of_all_poses_the_true_one_is_known_after_a_few_touches(uneven):
    rows, posteriors = uneven.observe(uneven.frames(uneven.slide(HEADINGS, 0.02, 1)))
    assert rows[0]["probability"] < 0.1
    assert rows[0]["hypotheses"] == 1600
    assert rows[-1]["right"]
    assert rows[-1]["true_probability"] > KNOWN
    assert rows[-1]["probability"] > KNOWN
    assert [row["path_m"] for row in rows] == sorted(row["path_m"] for row in rows)
    assert len(posteriors[-1].hypotheses) < 400


@pytest.mark.slow
def test_codes_alone_tell_less(uneven):
    frames = uneven.frames(uneven.slide(HEADINGS[:1], 0.02, 1))
    *_, codes = uneven.observe(frames, "codes")[0]
    *_, both = uneven.observe(frames, "both")[0]
    *_, maps = uneven.observe(frames)[0]
    assert codes["true_probability"] < min(maps["true_probability"], both["true_probability"])


def test_modulo_an_exact_symmetry_one_hypothesis_is_left(folded):
    rows, _ = folded.observe(folded.frames(folded.slide(HEADINGS, 0.03, 1)))
    assert rows[-1]["right"]
    assert rows[-1]["true_probability"] > KNOWN
    assert rows[-1]["credible"] == 1


@pytest.mark.slow
def test_copies_that_nothing_tells_apart_share_the_probability(folded):
    """The same slide, but the codebook knows of no symmetry."""
    unaware = copy.copy(folded)
    unaware.yardstick, unaware.model = Yardstick(), copy.copy(folded.model)
    unaware.model.symmetry = ObjectSymmetry()
    truth = folded.slide(HEADINGS, 0.02, 1)
    rows, posteriors = unaware.observe(unaware.frames(truth))
    left, at = posteriors[-1].hypotheses, truth[rows[-1]["frame"]]
    shares = [
        left.probabilities[unaware.yardstick.right(left.poses, image @ at)].sum() for image in OF_A_BOX.transforms
    ]
    assert sum(shares) > KNOWN
    assert shares == pytest.approx([0.25] * 4, abs=0.15)
    assert rows[-1]["probability"] < 0.5


@pytest.mark.slow
def test_what_is_dropped_would_not_have_mattered(uneven):
    frames = uneven.frames(uneven.slide(HEADINGS[:2], 0.015, 1))
    some, _ = uneven.observe(frames, dropped=1e-3)
    every, _ = uneven.observe(frames, dropped=0.0)
    assert some[-1]["hypotheses"] < 0.8 * every[-1]["hypotheses"]
    for one, other in zip(some, every, strict=True):
        assert one["true_probability"] == pytest.approx(other["true_probability"], abs=5e-3)


def test_a_prior_of_the_start_is_taken(uneven):
    frames = uneven.frames(uneven.slide([], 0.0, 1))
    (free,), _ = uneven.observe(frames)
    (near,), _ = uneven.observe(frames, prior=Prior(frames[0].truth, 2e-3, 0.1))
    assert near["true_probability"] > 10 * free["true_probability"]


@pytest.mark.slow
def test_after_a_kidnap_it_is_found_again(uneven):
    before, after = uneven.slide(HEADINGS[:2], 0.02, 1), uneven.slide(HEADINGS[:2], 0.04, 5)
    poses = np.concatenate([before, after[: 2 * len(before)]])
    scene = kidnap(Scene(uneven.frames(poses), np.random.default_rng(0)))
    rows, _ = uneven.observe(scene.frames, prior=Prior(poses[0], 5e-3, 0.2))
    known = [row for row in rows if row["frame"] < scene.event.start]
    again = [row for row in rows if row["frame"] >= scene.event.end]
    assert known[-1]["true_probability"] > KNOWN
    assert again[0]["true_probability"] < 0.5
    assert again[-1]["true_probability"] > KNOWN
    assert again[-1]["right"]


def hypotheses(poses: np.ndarray, log_evidence: np.ndarray) -> Hypotheses:
    count = len(poses)
    return Hypotheses(poses, np.tile(np.eye(6), (count, 1, 1)), np.full(count, -np.log(count)), log_evidence)


def test_hypotheses_that_meet_become_the_better_one_with_the_prior_of_all():
    rng = np.random.default_rng(0)
    pose = se3.make(se3.random_rotations(1, rng), rng.uniform(-0.02, 0.02, (1, 3)))[0]
    beside = pose @ se3.exp(np.array([1e-3, 0, 0, 0, 0, 0.01]))
    elsewhere = pose @ se3.exp(np.array([1e-3, 0, 0, 0, 0, 0.2]))
    every = hypotheses(np.stack([pose, OF_A_BOX.transforms[2] @ beside, elsewhere]), np.array([1.0, 2.0, 0.0]))
    left = every.merged(OF_A_BOX)
    assert len(left) == 2
    assert np.exp(left.log_prior) == pytest.approx([2 / 3, 1 / 3])
    assert left.log_evidence == pytest.approx([2.0, 0.0])
    assert len(every.merged(Symmetry())) == 3


def test_after_a_lift_what_was_believed_keeps_all_but_the_probability_of_a_change():
    poses = se3.make(se3.random_rotations(5, np.random.default_rng(1)), np.zeros((5, 3)))
    believed = hypotheses(poses[:2], np.array([3.0, 0.0]))
    both = believed.or_else(hypotheses(poses[2:], np.zeros(3)), 0.2)
    assert both.probabilities[:2] == pytest.approx(0.8 * believed.probabilities)
    assert both.probabilities[2:] == pytest.approx([0.2 / 3] * 3)


def test_a_codebook_without_a_sensor_cannot_be_observed(uneven):
    model = copy.copy(uneven.model)
    model.alignment = None
    with pytest.raises(InputError, match="does not name its sensor"):
        IdealObserver(model, NOISE, uneven.yardstick)
