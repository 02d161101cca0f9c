"""What `mujoco_arm` answers whoever plans for it."""

import numpy as np
import pytest
from geometry_msgs.msg import Pose, PoseArray, Quaternion
from std_msgs.msg import Header

from midastouch_common import se3
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_msgs.srv import CheckReach
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.nodes.mujoco_arm import MujocoArmNode

pytestmark = pytest.mark.dds


@pytest.fixture
def asked(graph):
    """Asks which poses in a frame are reached."""
    pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")
    graph.add(MujocoArmNode, {"mesh": str(bundled_objects()["ball"])})

    def ask(poses: list[Pose], frame: str = "base_link") -> CheckReach.Response:
        asked_for = PoseArray(header=Header(frame_id=frame), poses=poses)
        return graph.call(CheckReach, "mujoco_arm/check_reach", CheckReach.Request(poses=asked_for))

    return ask


def test_it_says_which_poses_it_reaches(asked):
    near, far = (pose_to_msg(se3.translation(np.array([x, 0.0, 0.35]))) for x in (0.45, 2.0))
    answer = asked([near, far, near])
    assert list(answer.reachable) == [True, False, True]
    assert "too short" in answer.message
    answer = asked([near])
    assert (list(answer.reachable), answer.message) == ([True], "")
    assert not asked([]).reachable
    for w, frame, why in ((1.0, "map", "it is in 'map'"), (0.0, "base_link", "quaternion")):
        answer = asked([Pose(orientation=Quaternion(w=w))], frame)
        assert len(answer.reachable) == 0
        assert why in answer.message
