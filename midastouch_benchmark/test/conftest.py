"""A world without networks: touches whose codes are a smooth function of the pose they were measured at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from midastouch_benchmark.evidence import fingerprint
from midastouch_benchmark.statistics.coverage import KINDS, LEVELS, WEIGHTS
from midastouch_benchmark.trials import trial_log
from midastouch_benchmark.trials.trial import ERROR_KEYS
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_perception.contact import Contact, ContactState
from midastouch_perception.pipeline import TouchReading
from midastouch_tools.progress import progress_bar

NETWORK = "pose-code"


@pytest.fixture(autouse=True, scope="module")
def known_fingerprint(request) -> Iterator[None]:
    """Ids that need not be measured, but for the tests of what measures them."""
    with pytest.MonkeyPatch.context() as patch:
        if "evidence" not in request.path.parts:
            ids = {"perception": "5ee00000", "slides": "51de0000", "estimates": "e5710000", "real_gel": "9e100000"}
            patch.setattr(fingerprint, "today", lambda: ids)
        yield


@pytest.fixture
def bars(monkeypatch) -> list:
    """The progress bars of campaigns, as they are opened."""
    opened: list = []
    monkeypatch.setattr(trial_log, "progress_bar", lambda **of: opened.append(progress_bar(**of)) or opened[-1])
    return opened


def encode(poses: np.ndarray) -> np.ndarray:
    """Unit codes (N, 48) that vary smoothly with position (10 mm) and rotation."""
    rng = np.random.default_rng(1)
    features = np.concatenate([poses[:, :3, 3] / 0.012, 0.7 * poses[:, :3, :3].reshape(-1, 9)], axis=1)
    angle = features @ rng.standard_normal((12, 24))
    codes = np.concatenate([np.cos(angle), np.sin(angle)], axis=1) / np.sqrt(24)
    return codes.astype(np.float32)


class PosePipeline:
    """Stands for image -> code: an image's first pixel is the number of the frame it shows."""

    def __init__(self, poses: np.ndarray):
        self._codes = encode(poses)
        self.ms = {"tdn": 2.0, "tcn": 1.0}

    def process(self, image: np.ndarray, background: np.ndarray) -> TouchReading:
        code = self._codes[int(image[0, 0, 0])]
        return TouchReading(Contact(np.zeros((160, 120), np.float32), 1e-4, 0.0, ContactState.CONTACT), code, NETWORK)


class StubSequence(SimpleNamespace):
    """The part of `datasets.Sequence` that evaluation uses, in memory."""

    def image(self, i: int) -> np.ndarray:
        image = np.zeros((4, 4, 3), np.uint8)
        image[0, 0, 0] = i
        return image


@pytest.fixture(scope="session")
def mesh() -> ObjectMesh:
    """A lopsided block with a pin: no symmetry."""
    block = trimesh.creation.box((0.08, 0.05, 0.03))
    pin = trimesh.creation.cylinder(0.008, 0.03).apply_translation((0.025, 0.01, 0.03))
    both = trimesh.util.concatenate([block.subdivide().subdivide(), pin])
    loaded = ObjectMesh.from_arrays(both.vertices, both.faces, "block")
    loaded.path = Path("block.ply")
    return loaded


def contact_poses(mesh: ObjectMesh, n: int, rng: np.random.Generator) -> np.ndarray:
    """Poses (n, 4, 4) 0.5 mm deep in the surface, any yaw."""
    points, normals, _ = mesh.sample_surface(n, rng)
    rotation = se3.frame_from_normal(normals, rng.uniform(0, 2 * np.pi, n))
    return se3.make(rotation, points - 5e-4 * normals)


@pytest.fixture(scope="session")
def codebook(mesh: ObjectMesh) -> Codebook:
    """4000 poses over the block."""
    poses = contact_poses(mesh, 4000, np.random.default_rng(2))
    meta = {"tcn": NETWORK, "mesh_name": "block", "mesh_sha256": mesh.sha256, "temperature": 0.1, "outlier": 0.05}
    return Codebook(poses, encode(poses), meta)


@pytest.fixture(scope="session")
def sequence(mesh: ObjectMesh) -> StubSequence:
    """30 frames straight over the block's upper side, measured with the paper's noise."""
    rng = np.random.default_rng(3)
    x = np.linspace(-0.03, 0.01, 30)
    points = np.stack([x, np.full(30, -0.012), np.full(30, 0.0145)], axis=1)
    poses = se3.make(se3.frame_from_normal(np.tile([0.0, 0, 1], (30, 1)), np.linspace(0, 0.4, 30)), points)
    measured = poses @ se3.exp(rng.standard_normal((30, 6)) * ([2e-4] * 3 + [5e-3] * 3))
    return StubSequence(
        dropped_frames=0,
        name="block/00",
        object_name="block",
        path=Path("block/00"),
        layout="simulated",
        sensor="digit_tacto",
        n_frames=30,
        poses_true=poses,
        poses_measured=measured,
        background=np.zeros((4, 4, 3), np.uint8),
        background_path=Path("background.png"),
    )


@pytest.fixture(scope="session")
def networks(sequence: StubSequence) -> SimpleNamespace:
    """What `Networks` offers a trial."""
    return SimpleNamespace(
        pipeline=lambda: PosePipeline(sequence.poses_true),
        describe=lambda: {"tdn": "none", "tcn": NETWORK, "sensor": "none"},
    )


@pytest.fixture(scope="session")
def draw_contacts(mesh: ObjectMesh):
    """Function (n, rng) -> contact poses (n, 4, 4) on the block with their codes (n, D)."""

    def draw(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        poses = contact_poses(mesh, n, rng)
        return poses, encode(poses)

    return draw


@pytest.fixture(scope="session")
def pose_codes():
    """Function poses (n, 4, 4) -> codes (n, D), the codebook's own."""
    return encode


@pytest.fixture(scope="session")
def trials(make_trial) -> list[dict]:
    """Of the default, exact in two of three, of a slow variant without the third, and of a fast one."""

    def trial(variant: str, seed: int, error: float, filter_ms: float, **final) -> dict:
        return make_trial(variant, seed, filter_ms, dict.fromkeys(ERROR_KEYS, error) | final)

    return [
        trial("default", 0, 2.0, 7.0),
        trial("default", 1, 4.0, 9.0),
        trial("default", 2, 100.0, 7.0, state="ambiguous"),
        trial("paper", 0, 12.0, 97.0),
        trial("paper", 1, 12.0, 97.0, state="ambiguous"),
        trial("5k", 0, 5.0, 1.0),
        trial("5k", 1, 5.0, 1.0),
        trial("5k", 2, 5.0, 1.0),
    ]


@pytest.fixture(scope="session")
def make_trial():
    """Factory of trials of 10 frames of `midastouch benchmark`, as `compare_variants` takes them.

    `final` has the errors of the last frame; `changes` replace what else is in a trial.
    """

    def make(variant: str, seed: int, filter_ms: float, final: Mapping[str, float | str], **changes) -> dict:
        counts = [0] * (len(LEVELS) + 1)
        counts[9] = 10
        weights = [0] * len(WEIGHTS) + [10]
        return {
            "object": "can",
            "slide": 0,
            "init": "paper",
            "seed": seed,
            "variant": variant,
            "frames": 10,
            "frames_converged": 8,
            "frames_converged_right": 6,
            "frames_foreign": 0,
            "frames_ambiguous": 2,
            "frames_ambiguous_among": 1,
            "right_from_frame": 3,
            "event_at": None,
            "right_before_event": None,
            "right_after_event": None,
            "initial": {"e_trans_mm": 50.0, "e_rot_deg": 60.0},
            "final": {"state": "converged", "foreign": False, "n_particles": 500} | judged(final) | final,
            "hz_mean": 50.0,
            "hz_p05": 40.0,
            "ms": {"tdn": 2.0, "tcn": 1.0, "filter": filter_ms},
            "filter_cpu_ms": filter_ms,
            "filter_stages_ms": {"motion": 1.0},
            "right_m": 0.01,
            "coverage": dict.fromkeys(KINDS, counts),
            "reliability": {"frames": weights, "right": weights},
        } | changes

    return make


def judged(final: Mapping[str, float | str]) -> dict[str, bool]:
    """What a trial with these errors says of its end."""
    poses = {"right": "estimate_trans_mm", "among_modes": "min_cluster_trans_mm"}
    return {what: final.get(error, np.inf) <= 10 for what, error in poses.items()}
