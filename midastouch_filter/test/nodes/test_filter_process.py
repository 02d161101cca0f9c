"""The executable `particle_filter` with real objects, spoken to over DDS from another process."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from filter_bench import is_answer
from filter_fakes import code_msg, pose_msg
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg, translation
from visualization_msgs.msg import MarkerArray

from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_msgs.srv import SetObject
from midastouch_perception.codebook import FORMAT, Codebook
from midastouch_perception.sensor_model import SensorModel

pytestmark = [pytest.mark.dds, pytest.mark.slow]
T_BASE_GEL = translation(0.4, 0.1, 0.2)


def write_object(folder: Path, name: str, vertices: np.ndarray, faces: np.ndarray, network: str) -> ObjectMesh:
    """A mesh file and a small codebook with random codes, as `build-codebook` would name them."""
    trimesh.Trimesh(vertices, faces, process=False).export(folder / f"{name}.ply")
    mesh = ObjectMesh.load(folder / f"{name}.ply")
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (500, 1, 1))
    poses[:, :3, 3] = mesh.sample_surface(500, rng)[0]
    sensor = SensorModel.load("digit_tacto")
    meta = {
        "format": FORMAT, "mesh_name": name, "mesh_sha256": mesh.sha256, "mesh_path": "", "sensor": sensor.name,
        "sensor_id": sensor.content_id, "tcn": network, "size": 500, "seed": 0, "temperature": 0.1, "outlier": 0.05,
    }  # fmt: skip
    codes = rng.standard_normal((500, 2)).astype(np.float32)
    codes /= np.linalg.norm(codes, axis=1, keepdims=True)
    Codebook(poses, codes, meta).save(folder / f"{name}.npz")
    return mesh


class Running:
    """The executable on `name` in a folder of objects, with its inputs and what it says."""

    def __init__(self, graph, folder: Path, name: str, preset: str):
        self.graph, self.folder = graph, folder
        parameters = {
            "mesh": folder / f"{name}.ply", "codebook": folder / f"{name}.npz", "max_particles": 1000,
            "preset": preset, "reliable": "true", "queue_depth": 100, "threads": 1, "refinement": "false",
            "view_rate": 0.0,
            "transform_timeout": 300.0,  # it may meet the publisher of the first one late
        }  # fmt: skip
        arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "midastouch_filter.nodes.particle_filter", "--ros-args", *arguments],
            env=os.environ.copy(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def connect(self) -> None:
        self.meshes = self.graph.listen(MarkerArray, "object_mesh", latched=True)
        self.statuses = self.graph.listen(FilterStatus, "filter_status", latched=True, wanted=is_answer)
        self.codes = self.graph.publisher(TactileCode, "tactile/code")
        self.tf = self.graph.publisher(TFMessage, "/tf")
        self._stamp = 0

    def frame(self, **code) -> FilterStatus:
        """Send the next frame, a second later at the same place; the status that answers it."""
        self._stamp += SECOND
        self.tf.publish(tf_msg(self._stamp, T_BASE_GEL))
        self.codes.publish(code_msg(self._stamp, **code))
        answers = []

        def answered() -> bool:
            answers[:] = [s for s in self.statuses if stamp_ns(s.header.stamp) == self._stamp]
            return bool(answers)

        self.graph.spin_until(answered, "an answer")
        return answers[0]

    def set_object(self, mesh: str, codebook: str = "") -> SetObject.Response:
        paths = self.folder / f"{mesh}.ply", self.folder / f"{codebook or mesh}.npz"
        request = SetObject.Request(mesh_path=str(paths[0]), codebook_path=str(paths[1]))
        return self.graph.call(SetObject, "set_object", request)

    def end(self) -> None:
        """Interrupt it; it must end cleanly."""
        self.process.send_signal(signal.SIGINT)
        try:
            said, _ = self.process.communicate(timeout=60)
        finally:
            self.process.kill()
        assert self.process.returncode == 0, said


@pytest.fixture
def objects(tmp_path) -> Path:
    """A folder with a box and a ball, a ball of another network and a file that is none."""
    box = trimesh.creation.box((0.06, 0.04, 0.03)).subdivide().subdivide()
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    write_object(tmp_path, "box", box.vertices, box.faces, "fake")
    write_object(tmp_path, "ball", ball.vertices, ball.faces, "fake")
    write_object(tmp_path, "foreign", ball.vertices * 0.9, ball.faces, "other")
    (tmp_path / "broken.ply").write_bytes(b"ply\nnonsense")
    return tmp_path


@pytest.fixture
def running(graph, objects, request):
    node = Running(graph, objects, "box", getattr(request, "param", "balanced"))
    try:
        node.connect()
        yield node
    finally:
        node.end()


def test_it_switches_between_objects(running, graph):
    assert running.frame().n_particles > 0
    for name, complaint in (
        ("broken", "broken.ply"),
        ("missing", "missing.ply"),
        ("foreign", "network other"),
    ):
        answer = running.set_object(name)
        assert not answer.success
        assert complaint in answer.message
    assert "'box'" in running.set_object("ball", "box").message
    assert running.frame().state in ("ambiguous", "searching")
    assert running.meshes[-1].markers[-1].mesh_resource.endswith("/box.ply")

    assert running.set_object("ball").success
    assert running.frame().state in ("ambiguous", "searching")
    graph.spin_until(lambda: running.meshes[-1].markers[-1].mesh_resource.endswith("/ball.ply"), "the mesh")


def test_it_starts_where_it_is_asked_to(running, graph):
    clouds = graph.listen(PoseArray, "particles")
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    priors = graph.publisher(PoseWithCovarianceStamped, "object_pose_prior")

    def distances(place) -> np.ndarray:
        """Of the particles to a place on the object, m, after one more frame without contact."""
        clouds.clear()
        running.frame(in_contact=False)
        graph.spin_until(lambda: clouds, "the particles")
        return np.linalg.norm([[p.position.x, p.position.y, p.position.z] for p in clouds[-1].poses] - place, axis=1)

    def eventually(condition) -> bool:
        """Whether it holds after one of the next frames: the node may hear a start after a later frame."""
        return any(condition() for _ in range(100))

    corner = np.array([0.03, 0.02, 0.015])
    assert distances(corner).max() > 0.05
    running.frame()

    starts.publish(pose_msg("object", translation(*corner), (1e-6,) * 3 + (1e-3,) * 3))
    assert eventually(lambda: np.median(distances(corner)) < 0.005)
    graph.call(Empty, "request_nomotion_update", Empty.Request())
    assert running.frame().n_particles > 0

    graph.call(Empty, "reinitialize_global_localization", Empty.Request())
    assert distances(corner).max() > 0.05

    # RViz's 2D Pose Estimate as it comes: half a metre of spread, and zeros that mean "unknown"
    rviz = (0.25, 0.25, 0.0, 0.0, 0.0, (math.pi / 12) ** 2)
    starts.publish(pose_msg("object", translation(*corner), rviz))
    # of the object's size, not half a metre
    assert eventually(lambda: 0.005 < np.median(distances(corner)) < 0.08)

    # The object is where the gel touches its opposite corner.
    priors.publish(pose_msg("base_link", T_BASE_GEL @ translation(*corner), (1e-6,) * 3 + (1e-4,) * 3))
    assert eventually(lambda: np.median(distances(-corner)) < 0.005)


@pytest.mark.parametrize("running", ["paper"], indirect=True)
def test_the_papers_filter_answers_and_goes_where_it_is_asked_to(running, graph):
    assert running.frame().n_particles == 50_000
    graph.call(Empty, "request_nomotion_update", Empty.Request())
    assert running.frame(in_contact=False).state == "no_contact"
    graph.call(Empty, "reinitialize_global_localization", Empty.Request())
    assert running.frame().n_particles == 50_000
    assert running.set_object("ball").success
    assert running.frame().n_modes > 0
