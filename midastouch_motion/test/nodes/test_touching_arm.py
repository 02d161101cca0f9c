"""An arm that follows twists, a simulated sensor, the depth network, `contact_controller`: a loop of messages."""

import cv2
import numpy as np
import pytest
from goals import Asked

from midastouch_common.mesh import ObjectMesh
from midastouch_motion.nodes.contact_controller import ContactController
from midastouch_msgs.action import Lift, Slide, Touch
from midastouch_msgs.msg import TactileContact
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.nodes.digit_sim import DigitSim
from midastouch_simulation.nodes.mujoco_arm import MujocoArmNode

pytestmark = [pytest.mark.dds, pytest.mark.slow]

ABOVE = 4e-3  # m


@pytest.fixture
def arm(graph, tmp_path):
    """A function that asks for a motion and returns its result; the gel begins straight above the ball."""
    mesh = ObjectMesh.load(bundled_objects()["ball"])
    pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")
    off = [1e-3, 0.0, 0.0, 0.02, 0.0, 0.0]
    settings = {"mesh": str(mesh.path), "above": ABOVE, "rate": 60.0, "latency": 0.02, "timeout": 1.0}
    # its time waits for the images: a busy machine is no fault
    graph.add(MujocoArmNode, settings | {"mount_error": off, "longest_delay": 0.1})
    background = str(tmp_path / "background.png")
    image = no_contact_image(SensorModel.load("digit_tacto"), np.random.default_rng(0))
    cv2.imwrite(background, image[..., ::-1])
    graph.add(
        DigitSim,
        {"mesh": str(mesh.path), "background": background, "fps": 15.0, "sensor_frame_id": "digit_gel_ground_truth"},
    )
    graph.add(TdnNode, {"background": background})
    settings = {"hold": 10.0, "stale_after": 10.0, "rate": 50.0, "arm_latency": 0.02}
    contact_controller = graph.add(ContactController, settings | {"use_sim_time": True})
    seen = graph.listen(TactileContact, "tactile/contact")
    graph.spin_until(lambda: len(seen) > 3, "contacts")
    graph.spin_until(lambda: contact_controller.describe()[2]["in_the_way"] == "nothing", "all that a motion needs")

    return lambda kind, **goal: Asked(graph.companion, graph.spin_until, kind, **goal).ended()


def test_it_touches_slides_and_lifts_on_an_unknown_surface(graph, arm):
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
