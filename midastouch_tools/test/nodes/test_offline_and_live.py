"""What evaluation measures is what the robot runs: the same frames offline and through the nodes, bit by bit."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from process_rig import SHIPPED, processes
from replay_rig import frames as counts
from replay_rig import play, replay

from midastouch_benchmark.trials.setup import Networks
from midastouch_benchmark.trials.trial import TrialFrame, run_trial
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.objects import bundled_objects
from midastouch_tools.bags.images import read_bag
from midastouch_tools.bags.writer import write_bag
from midastouch_tools.datasets import load_sequence
from midastouch_tools.datasets.slide_simulation import simulate_sequence

pytestmark = [pytest.mark.dds, pytest.mark.slow]
MESH = bundled_objects()["handle_tool"]
SEED = 3
SETTINGS = {"max_particles": 5000, "threads": 1}


@pytest.fixture(scope="module")
def networks() -> Networks:
    return Networks.load()


@pytest.fixture(scope="module")
def recording(tmp_path_factory, networks) -> Path:
    """A folder with a short slide, its bag, and a small codebook of the object."""
    folder, mesh = tmp_path_factory.mktemp("recording"), ObjectMesh.load(MESH)
    simulate_sequence(mesh, networks.sensor, 0.05, 2, folder / "slide")
    write_bag(load_sequence(folder / "slide"), folder / "slide.mcap")
    build_codebook(mesh, networks.tcn, networks.sensor, size=3000).save(folder / "book.npz")
    return folder


def evaluated(recording: Path, networks: Networks) -> tuple[list[TrialFrame], list[Estimate]]:
    """Every frame of the bag through what `midastouch evaluate` runs, with its estimate."""
    background = load_sequence(recording / "slide").background
    pipeline, frames, estimates = networks.pipeline(), [], []
    for i, frame in enumerate(read_bag(recording / "slide.mcap")):
        felt = measurement_of(pipeline.process(frame.image, background))
        frames.append(TrialFrame(i, felt, pipeline.ms, frame.base_from_gel, frame.object_from_gel_true))
    mesh = ObjectMesh.load(MESH)
    codebook = Codebook.load(recording / "book.npz", mesh=mesh)
    particle_filter = ParticleFilter(mesh, codebook, FilterConfig(**SETTINGS), SEED, clock=time.perf_counter)
    particle_filter.initialise_uniform()
    run_trial(frames, particle_filter, lambda _, estimate, __: estimates.append(estimate))
    return frames, estimates


def parameters(recording: Path) -> dict[str, dict]:
    """Of the nodes, by name."""
    queue = {"queue_depth": 100, "reliable": True, "use_sim_time": True}
    return {
        "tdn": {**queue, "background": str(recording / "slide" / "background.png")},
        "tcn": queue,
        "particle_filter": {
            **queue,
            **SETTINGS,
            "mesh": str(MESH),
            "codebook": str(recording / "book.npz"),
            "seed": SEED,
            "input_timeout": 1000.0,
        },
    }


def live(graph, recording: Path, folder: Path) -> tuple[list, list, list]:
    """Codes, poses and answers of the nodes to every frame of the bag, in order of their stamps."""
    stamps = load_sequence(recording / "slide").stamps_ns.tolist()
    with processes(SHIPPED, parameters(recording), folder):
        codes = graph.listen(TactileCode, "tactile/code")
        poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
        statuses = graph.listen(
            FilterStatus, "filter_status", latched=True, wanted=lambda s: s.state != FilterStatus.STATE_WAITING
        )
        settings = {"ack_topic": "filter_status", "clock": True, "wait_for_nodes": "tdn tcn particle_filter"}
        node = replay(graph, recording / "slide.mcap", **settings)
        play(graph, node)
        assert counts(node) == (len(stamps), 0, 0)
        for received, what in ((codes, "codes"), (poses, "poses"), (statuses, "answers")):
            graph.spin_until(lambda received=received: {*map(stamp_of, received)} >= {*stamps}, f"the {what}")
    answers = {stamp_of(status): status for status in statuses}
    return sorted(codes, key=stamp_of), sorted(poses, key=stamp_of), [answers[stamp] for stamp in stamps]


def test_evaluation_and_nodes_give_the_same_codes_and_estimates(graph, recording, networks, tmp_path):
    frames, estimates = evaluated(recording, networks)
    assert sum(frame.measurement.in_contact for frame in frames) > 10
    codes, poses, answers = live(graph, recording, tmp_path)
    while _without_relief(answers[-1]):  # a filter that got no CPU for long has given a cloud up, and says so
        graph.remove_all()
        codes, poses, answers = live(graph, recording, tmp_path)
    for frame, code in zip(frames, codes, strict=True):
        assert code.in_contact == frame.measurement.in_contact
        assert code.contact_area == np.float32(frame.measurement.contact_area)
        sent = np.zeros(0) if frame.measurement.code is None else frame.measurement.code
        np.testing.assert_array_equal(np.array(code.code, np.float32), sent, strict=frame.measurement.in_contact)
    for estimate, pose, answer in zip(estimates, poses, answers, strict=True):
        assert stamp_of(pose) == stamp_of(answer)
        assert pose.pose.pose == pose_to_msg(estimate.pose)
        np.testing.assert_array_equal(pose.pose.covariance, estimate.covariance.ravel())
        status = estimate.status
        assert (answer.state, answer.n_particles, answer.ess) == (status.state, status.n_particles, status.ess)


def _without_relief(status: FilterStatus) -> int:
    return dict(zip(status.skipped_names, status.skipped_counts, strict=True))["no_map"]


def stamp_of(msg) -> int:
    return stamp_ns(msg.header.stamp)
