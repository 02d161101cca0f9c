"""The gripper as a node, with a stand-in for perception and filter that knows the truth or is off by a turn."""

from __future__ import annotations

import numpy as np
import pytest
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common import se3
from midastouch_common.frames import TRUTH_FRAME
from midastouch_common.message_arrays import transform_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg, transform_to_msg
from midastouch_msgs.msg import FilterStatus, PoseMode, PoseModes, TactileContact
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.nodes.simulated_gripper import SimulatedGripperNode

pytestmark = pytest.mark.dds
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


class Rig:
    """A gripper; each image is answered, if the filter's pose is the true one followed by `off`."""

    def __init__(self, graph, state, off, symmetries):
        self.state, self.off, self.symmetries, self.ended, self.seen = state, off, symmetries, [], []
        me = graph.companion
        self.contacts = [
            me.create_publisher(TactileContact, f"{side}/tactile/contact", 10) for side in ("left", "right")
        ]
        self.modes = me.create_publisher(PoseModes, "left/object_pose_modes", 10)
        self.statuses = me.create_publisher(FilterStatus, "left/filter_status", qos.latched(100))
        me.create_subscription(TFMessage, "/tf", self.on_tf, qos.TF)
        given = {"mesh": str(bundled_objects()["handle_tool"]), "untouched_frames": 3, "pinches": 2}
        self.node = graph.add(lambda **options: SimulatedGripperNode(lambda: self.ended.append(1), **options), given)
        graph.spin_until(lambda: self.ended, "the end of the pinches")

    def on_tf(self, message):
        frames = {one.child_frame_id: transform_from_msg(one.transform) for one in message.transforms}
        self.seen.append(frames)
        header = Header(stamp=message.transforms[0].header.stamp)
        for contact in self.contacts:
            contact.publish(TactileContact(header=header))
        pose = PoseMode(weight=1.0)
        pose.pose.pose = pose_to_msg(se3.inverse(frames["gripper"]) @ frames[TRUTH_FRAME] @ self.off)
        alike = [transform_to_msg(each) for each in self.symmetries]
        self.modes.publish(PoseModes(header=header, modes=[pose], symmetries=alike, symmetry_free="none"))
        self.statuses.publish(FilterStatus(header=header, state=self.state))


@pytest.mark.parametrize(
    ("state", "off", "symmetries", "pinches", "gave_up"),
    [
        ("converged", np.eye(4), [np.eye(4)], 1, False),
        ("converged", HALF_TURN, [np.eye(4)], 1, True),
        ("converged", HALF_TURN, [np.eye(4), HALF_TURN], 1, False),
        ("ambiguous", np.eye(4), [np.eye(4)], 2, True),
    ],
    ids=["right", "half a turn off", "alike", "never sure"],
)
def test_it_ends_once_the_filter_is_sure_and_judges_it(graph, state, off, symmetries, pinches, gave_up):
    rig = Rig(graph, state, off, symmetries)
    assert rig.node.gave_up is gave_up
    heights = np.array([frames[TRUTH_FRAME][2, 3] for frames in rig.seen])
    lifted = heights > heights[0] + 0.07
    assert np.count_nonzero(np.diff(lifted.astype(int)) == 1) == pinches
    first = [frames["left_digit_gel_frame"] for frames in rig.seen[:3]]
    assert np.ptp(first, axis=0).max() == 0, "it waits for the background"
