"""Several sensors on one filter node: real DDS, simulated fingers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from filter_bench import OBJECT, Bench, skipped
from filter_fakes import cloud_msg, code_msg, loader_of
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg, translation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND, pose_from_msg, stamp_ns, transform_from_msg
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import reduced_penetration
from midastouch_filter.loaded_object import LoadedObject
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, PoseModes, TactileCode

pytestmark = pytest.mark.dds
T_GEL_RIGHT = se3.exp(np.array([0.01, 0, -0.05, np.pi, 0, 0]))
MS = 1_000_000


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """A finger is waited for no longer than tests take."""
    monkeypatch.setattr("midastouch_filter.nodes.finger_topics.RELIABLE_TIMEOUT", 2.0)


class Hand(Bench):
    """A filter node with a second finger, /right, and the topics of both."""

    def __init__(self, graph, load=None, **parameters):
        super().__init__(graph, load, **{**OBJECT, "fingers": "/right:right_gel", "refinement": True, **parameters})
        self.touches = [self.codes, graph.publisher(TactileCode, "/right/tactile/code")]
        if parameters.get("refinement", True):
            self.clouds = [graph.publisher(PointCloud2, f"{finger}tactile/points") for finger in ("", "/right/")]

    def place(self, stamp: int, T_base_gel: np.ndarray, T_base_right: np.ndarray | None = None) -> None:
        self.tf.publish(tf_msg(stamp, T_base_gel))
        self.tf.publish(
            tf_msg(stamp, T_base_gel @ T_GEL_RIGHT if T_base_right is None else T_base_right, child="right_gel")
        )

    def answer(self, stamp: int) -> FilterStatus:
        """The status of the frame at `stamp` [ns]."""
        self.graph.spin_until(lambda: self.answers(stamp), f"the answer to {stamp}")
        return self.answers(stamp)[-1]

    def frame(self, stamp: int, fingers=(0, 1), **code) -> FilterStatus:
        """A frame in which these fingers measure something, without clouds."""
        self.place(stamp, translation(1e-9 * stamp * 0.01))
        for finger in sorted(fingers, reverse=True):
            self.touches[finger].publish(code_msg(stamp, **code))
        return self.answer(stamp)


def test_each_frame_has_what_the_other_finger_measured_and_where(graph):
    hand = Hand(graph, refinement=False)
    for k in range(1, 4):
        hand.frame(k * SECOND)
    assert len(hand.filter.others) == 3
    for others in hand.filter.others:
        (name,) = others
        assert name == "/right"
        np.testing.assert_allclose(others[name].T_gel_finger, T_GEL_RIGHT, atol=1e-9)
        np.testing.assert_allclose(others[name].code, [0.6, 0.8], atol=1e-6)


def test_an_image_has_its_finger_s_pose_at_its_own_stamp(graph):
    """Both fingers move; the second camera's image is 12 ms older."""
    hand = Hand(graph, refinement=False)
    for k in range(3):
        hand.place(SECOND + 100 * MS * k, translation(0.01 * k), translation(0.2, 0.05 * k))
    hand.touches[1].publish(code_msg(SECOND + 138 * MS))
    hand.touches[1].publish(code_msg(SECOND + 171 * MS))
    hand.touches[0].publish(code_msg(SECOND + 150 * MS))
    hand.answer(SECOND + 150 * MS)
    np.testing.assert_allclose(
        hand.filter.others[0]["/right"].T_gel_finger, translation(0.2 - 0.015, 0.05 * 1.38), atol=1e-6
    )


def test_a_frame_waits_for_the_other_fingers_code_and_cloud(graph):
    hand = Hand(graph)
    depths = [2e-4, 5e-4, 1e-3]
    maps = np.zeros((3, 160, 120), np.float32)
    maps[:, 60:80, 40:60] = np.array(depths)[:, None, None]
    hand.frame(SECOND, (0, 1), in_contact=False)
    for k, penetration in enumerate(maps):
        stamp = (2 + k) * SECOND
        hand.place(stamp, np.eye(4))
        hand.touches[0].publish(code_msg(stamp))
        hand.clouds[0].publish(cloud_msg(stamp, penetration))
        hand.touches[1].publish(code_msg(stamp + 5 * MS))
        hand.clouds[1].publish(cloud_msg(stamp + 5 * MS, 0.5 * penetration))
        hand.place(stamp + 5 * MS, np.eye(4))
        hand.answer(stamp)
        touch = hand.filter.others[-1]["/right"]
        np.testing.assert_allclose(touch.penetration, reduced_penetration(0.5 * penetration), atol=1e-7)
        np.testing.assert_allclose(
            hand.filter.measurements[-1].penetration, reduced_penetration(penetration), atol=1e-7
        )


def test_a_finger_that_falls_silent_is_left_out_and_named(graph, timeout_clock):
    hand = Hand(graph, refinement=False, input_timeout=0.3)
    assert "without" not in hand.frame(SECOND).reason
    timeout_clock.now += 0.35
    status = hand.frame(2 * SECOND, (0,))
    assert status.reason.endswith("; without /right")
    assert status.state == "ambiguous"
    assert hand.filter.others[-1] == {}
    assert skipped(status)["missing_code of /right"] == 1
    assert hand.node.diagnostics.counts["silent_fingers"] == 1
    hand.touches[1].publish(code_msg(3 * SECOND))

    def is_back() -> bool:
        hand.touches[0].publish(code_msg(2 * SECOND))  # answered at once: it was here before
        return "without" not in hand.statuses[-1].reason

    graph.spin_until(is_back, "an answer that does not name the finger")
    hand.frame(4 * SECOND)
    assert list(hand.filter.others[-1]) == ["/right"]


def test_a_finger_that_lags_is_waited_for_once(graph):
    hand = Hand(graph, refinement=False)
    hand.frame(SECOND)
    statuses = []
    for k in range(1, 6):
        stamp = SECOND + k * 33 * MS
        hand.place(stamp, translation(0.001 * k))
        hand.touches[0].publish(code_msg(stamp))
        statuses.append(hand.answer(stamp))
    assert [others == {} for others in hand.filter.others[1:]] == [True] * 5
    assert skipped(statuses[-1])["missing_code of /right"] == 5
    awaited = [stamp_ns(wait.header.stamp) for wait in hand.waits if "still to come" in wait.reason]
    assert [stamp for stamp in awaited if stamp > SECOND] == [SECOND + 33 * MS]
    hand.frame(SECOND + 200 * MS)
    hand.frame(SECOND + 233 * MS)
    assert list(hand.filter.others[-1]) == ["/right"]


def test_a_finger_without_a_hypothesis_is_left_out(graph):
    hand = Hand(graph, refinement=False, fingers="/right:nowhere")
    status = hand.frame(SECOND)
    assert skipped(status)["missing_transform of /right"] == 1
    assert status.state == "ambiguous"


def test_codes_of_another_network_cost_that_finger_only(graph):
    def load(*arguments) -> LoadedObject:
        return dataclasses.replace(loader(*arguments), network_id="fake")

    filters = []
    loader = loader_of(filters)
    hand = Hand(graph, load=load, refinement=False)
    hand.place(SECOND, np.eye(4))
    hand.touches[1].publish(code_msg(SECOND, network_id="other"))
    hand.touches[0].publish(code_msg(SECOND))
    status = hand.answer(SECOND)
    assert status.state == "ambiguous"
    assert filters[0].others == [{}]
    assert skipped(status)["foreign_code of /right"] == 1
    assert hand.node.diagnostics.counts["bad_codes"] == 1


def test_time_that_runs_back_forgets_what_fingers_measured(graph):
    hand = Hand(graph, refinement=False)
    for loop in range(2):
        hand.statuses.clear()
        for k in range(100, 103):
            hand.frame(k * SECOND)
        assert hand.filter.starts == ["uniform"] * (loop + 1)
    assert [list(others) for others in hand.filter.others] == [["/right"]] * 6


def test_what_a_gripper_holds_goes_with_it_and_is_published_in_its_frame(graph):
    hand = Hand(graph, refinement=False, gripper_frame_id="gripper")
    hand.filters[0].state = CONVERGED
    poses = graph.listen(PoseWithCovarianceStamped, "object_pose", latched=True)
    modes = graph.listen(PoseModes, "object_pose_modes")
    placed = graph.listen(TFMessage, "/tf", wanted=lambda msg: msg.transforms[0].child_frame_id == "object")
    T_gripper_gel = se3.exp(np.array([0.02, 0.0, 0.1, 0.3, -0.2, 0.1]))
    for k, touching in enumerate([False, True, True, False], 1):
        hand.tf.publish(tf_msg(k * SECOND, translation(0.1 * k), child="gripper"))
        hand.tf.publish(tf_msg(k * SECOND, T_gripper_gel, "gripper"))
        hand.tf.publish(tf_msg(k * SECOND, T_gripper_gel @ T_GEL_RIGHT, "gripper", "right_gel"))
        for touches in reversed(hand.touches):
            touches.publish(code_msg(k * SECOND, in_contact=touching))
        hand.answer(k * SECOND)
    carried = [se3.log(odometry)[:3] for odometry in hand.filter.odometry[1:]]
    np.testing.assert_allclose(np.linalg.norm(carried, axis=1), [0.1, 0.0, 0.0], atol=1e-9)
    graph.spin_until(lambda: len(poses) == len(modes) == 2 and len(placed) == 4, "what is in the gripper")
    believed = T_gripper_gel @ se3.inverse(se3.translation(T_gripper_gel[:3, :3].T @ [0.1, 0.0, 0.0]))
    for message in (poses[0], modes[0]):
        assert (stamp_ns(message.header.stamp), message.header.frame_id) == (2 * SECOND, "gripper")
    for pose in (poses[0].pose, modes[0].modes[0].pose):
        np.testing.assert_allclose(pose_from_msg(pose.pose), believed, atol=1e-9)
    lever = np.linalg.norm(believed[:3, 3] - T_gripper_gel[:3, 3])
    spread = np.trace(np.reshape(poses[0].pose.covariance, (6, 6))[:3, :3])
    assert 6e-6 + 3e-4 * lever**2 < spread < 6e-6 + 5e-4 * lever**2
    assert placed[0].transforms[0].header.frame_id == "gripper"
    np.testing.assert_allclose(transform_from_msg(placed[1].transforms[0].transform), believed, atol=1e-9)


def test_a_gripper_whose_frame_is_missing_is_said(graph):
    hand = Hand(graph, refinement=False, gripper_frame_id="nowhere")
    status = hand.frame(SECOND)
    assert status.state == "stale"
    assert "nowhere -> digit_gel_frame: is gripper_frame_id right?" in status.reason
    assert not hand.filter.measurements
    assert hand.node.diagnostics.counts["no_gripper"] == 1


def test_a_gripper_has_several_sensors(graph):
    with pytest.raises(InputError, match=r"'gripper_frame_id': .*fingers"):
        graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), {"gripper_frame_id": "tool0"})


@pytest.mark.parametrize(
    "fingers", ["right", "/right:", "/right:a b", "/right:a,/right:b", ":frame", "/r:digit_gel_frame", "/ré:frame"]
)
def test_what_names_no_fingers_is_refused(graph, fingers):
    with pytest.raises(InputError, match="parameter 'fingers'"):
        graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), {**OBJECT, "fingers": fingers})
