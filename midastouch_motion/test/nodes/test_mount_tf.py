import numpy as np
import pytest
from tf2_msgs.msg import TFMessage

from midastouch_common.message_arrays import transform_from_msg
from midastouch_motion.nodes.mount_tf import MountTf

pytestmark = pytest.mark.dds


def test_the_mount_is_there_for_who_comes_late(graph):
    graph.add(MountTf, {"sensor_prefix": "left_", "tf_prefix": "a_", "tool_frame": "tool0_controller"})
    static = graph.listen(TFMessage, "/tf_static", latched=True)
    graph.spin_until(lambda: static, "the mount")
    found = {(t.header.frame_id, t.child_frame_id): transform_from_msg(t.transform) for t in static[0].transforms}
    assert set(found) == {
        ("a_tool0_controller", "left_digit_link"),
        ("left_digit_link", "left_digit_gel_frame"),
        ("left_digit_link", "left_digit_optical_frame"),
    }
    gel = found["left_digit_link", "left_digit_gel_frame"]
    np.testing.assert_allclose(gel[:3, 3], [0.0, 0.0, 0.018])
