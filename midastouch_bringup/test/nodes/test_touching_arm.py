"""An arm that follows twists, a simulated sensor, the depth network and `slider`: the loop closed by messages."""

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from rclpy.action import ActionClient
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage

from midastouch_bringup.datasets.slide_simulation import no_contact_image
from midastouch_bringup.nodes.digit_sim import DigitSim
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import transform_to_msg
from midastouch_motion.nodes.mujoco_arm import MujocoArmNode
from midastouch_motion.nodes.slider import Slider
from midastouch_motion.nodes.twist_arm import TwistArm
from midastouch_msgs.action import Lift, Slide, Touch
from midastouch_msgs.msg import TactileContact
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel

pytestmark = [pytest.mark.dds, pytest.mark.slow]

ABOVE = 4e-3  # m


def without_joints(graph, mesh):
    """What follows twists, and the frame in which its gel really is."""
    start = se3.to_xyzquat(se3.make(np.eye(3), np.array([0, 0, mesh.bounds[1, 2] + ABOVE]))).tolist()
    graph.add(TwistArm, {"start": start, "rate": 60.0, "latency": 0.02, "timeout": 1.0})
    at_base = TransformStamped(header=Header(frame_id="base_link"), child_frame_id="object_ground_truth")
    at_base.transform = transform_to_msg(np.eye(4))
    graph.companion.create_publisher(TFMessage, "/tf_static", qos.latched()).publish(TFMessage(transforms=[at_base]))
    return {}, "digit_gel_frame"


def in_mujoco(graph, mesh):
    """The same of an arm with joints and forces, whose gel is mounted a little off."""
    pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")
    off = [1e-3, 0.0, 0.0, 0.02, 0.0, 0.0]
    settings = {"mesh": str(mesh.path), "above": ABOVE, "rate": 60.0, "latency": 0.02, "timeout": 1.0}
    graph.add(MujocoArmNode, settings | {"mount_error": off, "longest_delay": 0.1})
    return {"use_sim_time": True}, "digit_gel_ground_truth"


@pytest.fixture(params=[without_joints, in_mujoco])
def arm(request, graph, tmp_path):
    """A function that asks for a motion and returns its result; the gel begins straight above the ball."""
    mesh = ObjectMesh.load(bundled_objects()["ball"])
    time_of, frame = request.param(graph, mesh)
    background = str(tmp_path / "background.png")
    image = no_contact_image(SensorModel.load("digit_tacto"), np.random.default_rng(0))
    cv2.imwrite(background, image[..., ::-1])
    graph.add(DigitSim, {"mesh": str(mesh.path), "background": background, "fps": 15.0, "sensor_frame_id": frame})
    graph.add(TdnNode, {"background": background})
    # one thread, perhaps on a busy machine: late is no fault here
    slider = graph.add(Slider, time_of | {"hold": 10.0, "stale_after": 10.0, "rate": 50.0, "arm_latency": 0.02})
    enable = graph.publisher(Bool, "slider/enable", qos.COMMAND)
    seen = graph.listen(TactileContact, "tactile/contact")
    graph.spin_until(lambda: len(seen) > 3, "contacts")

    def ready() -> bool:
        enable.publish(Bool(data=True))
        return slider.describe()[2]["in_the_way"] == "nothing"

    graph.spin_until(ready, "all that a motion needs")

    def ask(kind, **goal):
        client = ActionClient(graph.companion, kind, kind.__name__.lower())
        graph.spin_until(client.server_is_ready, "the action")
        results = []
        enable.publish(Bool(data=True))
        client.send_goal_async(kind.Goal(**goal)).add_done_callback(
            lambda accepted: accepted.result().get_result_async().add_done_callback(results.append)
        )

        def ended() -> bool:
            enable.publish(Bool(data=True))
            return bool(results)

        graph.spin_until(ended, f"the end of {kind.__name__}")
        return results[0].result().result

    return ask


def test_it_touches_slides_and_lifts_without_being_told_where_the_surface_is(graph, arm):
    truth = graph.listen(TactileContact, "ground_truth/contact")
    touched = arm(Touch, distance=0.02)
    assert touched.success, touched.message
    assert touched.path == pytest.approx(ABOVE, abs=2e-3)
    assert truth[-1].depth == pytest.approx(5e-4, abs=3e-4)
    slid = arm(Slide, heading=0.5, length=0.01)
    assert slid.success, slid.message
    assert truth[-1].in_contact
    assert max(contact.depth for contact in truth) < 1.5e-3
    lifted = arm(Lift, height=5e-3)
    assert lifted.success, lifted.message
    graph.spin_until(lambda: not truth[-1].in_contact, "the lift to be seen")
