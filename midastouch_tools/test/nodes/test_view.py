"""The view's node over DDS: what it hands to the scene, how often, and what it refuses."""

import math
import time
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose
from visualization_msgs.msg import MarkerArray

from midastouch_common import se3
from midastouch_common.frames import TRUTH_FRAME, TRUTH_GEL_FRAME
from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import image_to_msg, points_to_msg, pose_to_msg, stamp_from_ns, transform_to_msg
from midastouch_filter.nodes import markers
from midastouch_msgs.msg import FilterStatus, PoseMode, PoseModes
from midastouch_perception.objects import bundled_objects
from midastouch_tools.nodes.view import View

pytestmark = pytest.mark.dds
POSE = se3.exp(np.array([0.01, 0.02, 0.03, 0.1, 0.2, 0.3]))


class Scene:
    """Records what it is told, as (method, arguments)."""

    def __init__(self):
        self.calls = []

    def __getattr__(self, name):
        return lambda *arguments: self.calls.append((name, arguments))

    def of(self, name):
        return [arguments for called, arguments in self.calls if called == name]


@pytest.fixture
def scene():
    return Scene()


@pytest.fixture
def view(graph, scene):
    node = graph.add(lambda **options: View(scene, **options), {"rate": 20.0})
    ((state, _, _),) = scene.of("status")
    assert state == "waiting"
    scene.calls.clear()
    return node


def header(stamp=SECOND, frame="object"):
    return Header(stamp=stamp_from_ns(stamp), frame_id=frame)


def covariance_pose(variances):
    msg = PoseMode(weight=0.75)
    msg.pose.pose = pose_to_msg(POSE)
    msg.pose.covariance = np.diag(variances).ravel().tolist()
    return msg


def test_everything_arrives_in_the_scene(graph, scene, view):
    pixels = np.random.default_rng(0).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    positions = np.random.default_rng(1).normal(0, 0.1, (60_000, 3)).astype(np.float32)
    weights = np.linspace(0, 2, 60_000)
    poses = se3.translation(positions)
    graph.publisher(Image, "image_raw").publish(image_to_msg(pixels, "rgb8", header()))
    graph.publisher(PointCloud2, "particles/cloud").publish(markers.particle_cloud(poses, weights / 60_000, header()))
    graph.publisher(PointCloud2, "tactile/points").publish(
        points_to_msg(positions[:50], header(frame="digit_gel_frame"))
    )
    mode = covariance_pose([1e-6, 2e-6, 3e-6, 1e-4, 2e-4, 3e-4])
    graph.publisher(PoseModes, "pose_modes").publish(PoseModes(header=header(), modes=[mode]))
    pose = PoseWithCovarianceStamped(header=header(), pose=mode.pose)
    graph.publisher(PoseWithCovarianceStamped, "pose", latched=True).publish(pose)
    truth = TransformStamped(header=header(frame=TRUTH_FRAME), child_frame_id=TRUTH_GEL_FRAME)
    truth.transform = transform_to_msg(POSE)
    graph.publisher(TFMessage, "/tf").publish(TFMessage(transforms=[TransformStamped(), truth]))
    status = FilterStatus(header=header(), state="ambiguous", reason="two places", n_particles=800, ess=math.nan)
    graph.publisher(FilterStatus, "filter_status", latched=True).publish(status)
    drawn = ("image", "particles", "contact", "modes", "estimate", "truth", "status")
    graph.spin_until(lambda: all(scene.of(name) for name in drawn), "all of the scene")

    np.testing.assert_array_equal(scene.of("image")[0][0], pixels)
    np.testing.assert_allclose(scene.of("particles")[0][0], positions)
    np.testing.assert_allclose(scene.of("particles")[0][1], poses[:, :3, 2])
    np.testing.assert_allclose(scene.of("particles")[0][2], weights, atol=1e-6)
    np.testing.assert_allclose(scene.of("contact")[0][0], positions[:50])
    (mode_weights, mode_poses, covariances) = scene.of("modes")[0]
    assert mode_weights == [0.75]
    np.testing.assert_allclose(mode_poses, [POSE], atol=1e-9)
    np.testing.assert_allclose(np.diagonal(covariances[0]), [1e-6, 2e-6, 3e-6, 1e-4, 2e-4, 3e-4])
    np.testing.assert_allclose(scene.of("estimate")[0][0], POSE, atol=1e-9)
    np.testing.assert_allclose(scene.of("truth")[0][0], POSE, atol=1e-9)
    state, reason, numbers = scene.of("status")[0]
    assert (state, reason, numbers["particles/all"]) == ("ambiguous", "two places", 800)
    assert "particles/effective" not in numbers  # not finite


def test_an_earlier_mesh_is_shown_and_a_missing_one_survived(graph, scene):
    meshes = graph.companion.create_publisher(MarkerArray, "object_mesh", qos.latched())
    path = Path(bundled_objects()["ball"])
    meshes.publish(markers.object_mesh(path.resolve().as_uri(), header()))
    graph.add(lambda **options: View(scene, **options), {"rate": 20.0})
    graph.spin_until(lambda: scene.of("mesh"), "the mesh")
    vertices, faces, normals = scene.of("mesh")[0]
    assert faces.max() < len(vertices) == len(normals)
    meshes.publish(markers.object_mesh("file:///nowhere/cup.ply", header()))
    meshes.publish(markers.object_mesh("package://no_such_package/cup.ply", header()))
    graph.spin_for(0.2)
    meshes.publish(markers.object_mesh(path.resolve().as_uri(), header()))
    graph.spin_until(lambda: len(scene.of("mesh")) == 2, "the mesh again")


def test_a_flood_is_thinned_to_the_newest(graph, scene):
    graph.add(lambda **options: View(scene, **options), {"rate": 5.0})
    images = graph.publisher(Image, "image_raw")
    started = time.monotonic()
    for i in range(30):
        images.publish(image_to_msg(np.full((4, 4, 3), i, np.uint8), "rgb8", header(i)))
        graph.spin_for(0.01)
    graph.spin_until(lambda: scene.of("image") and scene.of("image")[-1][0].max() == 29, "the newest image")
    assert len(scene.of("image")) <= 2 + 5.0 * (time.monotonic() - started)


@pytest.mark.parametrize(
    ("frames", "drawn"),
    [
        (
            [(10, "ambiguous"), (11, "ambiguous"), (2, "ambiguous"), (3, "ambiguous")],
            "status status restart status status",
        ),
        ([(10, "ambiguous"), (0, "stale"), (11, "ambiguous")], "status status status"),  # dropped for its stamp
        ([(10, "ambiguous"), (13, "waiting"), (11, "lost"), (12, "lost")], "status status status status"),
    ],
    ids=["a looped bag", "a dropped frame", "answers older than a waiting frame"],
)
def test_only_a_looped_bag_clears_the_scene(graph, scene, view, frames, drawn):
    statuses = graph.publisher(FilterStatus, "filter_status", latched=True)
    for n, (stamp, state) in enumerate(frames, 1):
        statuses.publish(FilterStatus(header=header(stamp * SECOND), state=state))
        graph.spin_until(lambda n=n: len(scene.of("status")) == n, "a status")
    assert " ".join(name for name, _ in scene.calls) == drawn


def test_unusable_messages_do_not_end_the_view(graph, scene, view):
    images, clouds = graph.publisher(Image, "image_raw"), graph.publisher(PointCloud2, "particles/cloud")
    modes = graph.publisher(PoseModes, "pose_modes")
    images.publish(Image(height=3, width=3, encoding="rgb8", step=9))
    clouds.publish(points_to_msg(np.zeros((5, 3)), header()))  # without weights
    bad = covariance_pose([math.nan] * 6)
    modes.publish(PoseModes(header=header(), modes=[bad]))
    graph.spin_for(0.2)
    modes.publish(PoseModes(header=header()))
    graph.spin_until(lambda: scene.of("modes"), "modes after bad ones")
    assert not scene.of("image")
    assert not scene.of("particles")


def test_a_calibration_s_guide_is_picked_out_of_diagnostics(graph, scene, view):
    health = graph.publisher(DiagnosticArray, "/diagnostics")
    guide = DiagnosticStatus(name="calibrate: /calibrate", message="1 of 10: lift the ball")
    guide.values = [KeyValue(key="taken", value="1"), KeyValue(key="region", value="centre")]
    health.publish(DiagnosticArray(status=[guide]))
    for name in ("tdn: /tdn", "calibrate: /left/calibrate"):
        health.publish(DiagnosticArray(status=[DiagnosticStatus(name=name, message="another")]))
    graph.spin_until(lambda: scene.of("guidance"), "the guide")
    graph.spin_for(0.2)
    assert scene.of("guidance") == [("1 of 10: lift the ball", {"taken": "1", "region": "centre"})]


def test_possible_objects_are_passed_on_until_nothing_is_known(graph, scene, view):
    objects = graph.publisher(Detection3DArray, "object_hypotheses", latched=True)
    found = [
        Detection3D(results=[ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id=name, score=score))])
        for name, score in (("mug", 0.75), ("unknown", 0.25))
    ]
    objects.publish(Detection3DArray(detections=[Detection3D()]))  # malformed: without a hypothesis
    graph.spin_for(0.2)
    objects.publish(Detection3DArray(detections=found))
    graph.spin_until(lambda: scene.of("objects"), "the objects")
    assert scene.of("objects") == [({"mug": 0.75, "unknown": 0.25},)]
    status = FilterStatus(header=header(), state="uninitialised")
    graph.publisher(FilterStatus, "filter_status", latched=True).publish(status)
    graph.spin_until(lambda: scene.of("objects")[-1] == ({},), "that nothing is known")


def test_it_says_when_the_filter_falls_silent(graph, scene, monkeypatch):
    monkeypatch.setattr("midastouch_tools.nodes.view.SILENT_S", 0.3)
    graph.add(lambda **options: View(scene, **options), {"rate": 20.0})
    publishers = [graph.publisher(FilterStatus, "filter_status", latched=True)]
    publishers[0].publish(FilterStatus(header=header(), state="lost"))

    def said() -> list[str]:
        return [call[0] for call in scene.of("status")]

    graph.spin_until(lambda: said()[-2:] == ["lost", "no filter_status"], "the silence")
    assert "it last said lost: " in scene.of("status")[-1][1]
    publishers.append(status := graph.publisher(FilterStatus, "filter_status", latched=True))
    before = len(said())
    status.publish(FilterStatus(header=header(), state="ambiguous"))
    graph.spin_until(lambda: len(said()) == before + 2, "the next silence")
    assert said()[before:] == ["ambiguous", "no filter_status"]
    for publisher in publishers:
        graph.companion.destroy_publisher(publisher)
    graph.spin_until(lambda: said()[-1] == "ended", "the end of the filter")
