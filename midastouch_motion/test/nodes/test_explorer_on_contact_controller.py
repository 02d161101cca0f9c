"""The explorer on an arm: `contact_controller` follows what the sensor measures, in a time that its twists drive."""

import time

import numpy as np
import pytest
from explorer_rig import BALL, RADIUS
from geometry_msgs.msg import TwistStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from simulated_arm import SimulatedArm
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg
from visualization_msgs.msg import MarkerArray

from midastouch_common import se3
from midastouch_common.frames import GEL_FRAME, TRUTH_FRAME
from midastouch_common.mesh import ObjectMesh
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import points_to_msg, pose_to_msg, stamp_from_ns
from midastouch_filter.nodes.markers import object_mesh
from midastouch_motion.nodes.contact_controller import ContactController
from midastouch_motion.nodes.explorer import Explorer
from midastouch_msgs.msg import ExplorerStatus, FilterStatus, PoseMode, PoseModes, Suggestion, TactileContact
from midastouch_msgs.srv import SuggestMotion
from midastouch_perception.contact import Contact
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds
PERIOD_NS, PER_IMAGE = 10_000_000, 3  # of control; an image in so many
LATE = 0.05  # s of real time, for a twist that may not come as nothing moves
LONGEST_NS = 600 * 10**9  # of its own time, which bounds a failing test however slow the machine is
OBJECT = se3.translation([0.4, 0.0, 0.1])  # T_base_obj
LEAST_AREA = 1.5e-6  # m^2
FAST = {"speed": 0.03, "air_speed": 0.2, "turn_speed": 2.0, "acceleration": 2.0, "max_depth": 2e-3, "arm_latency": 0.02}


class Rig:
    """Controller and explorer over the ball, an arm that follows twists, an operator, and a filter that knows the pose.

    Attributes: state, which the filter says where the gel touches; statuses of the explorer; highest [m], of the gel.
    """

    def __init__(self, graph, **parameters):
        self.graph, self.state, self.enabled = graph, "ambiguous", True
        self._sensor = SensorModel.load("digit_tacto").for_maps
        self._renderer = PenetrationRenderer(ObjectMesh.load(BALL), self._sensor)
        self._now, self._steps = 1_000_000_000, 0
        over = se3.translation([0.0, 0.0, RADIUS + 5e-3])
        self.arm = SimulatedArm(OBJECT @ over, latency=0.02, timeout=1.0)
        in_simulation = {"use_sim_time": True}
        self.contact_controller = graph.add(ContactController, FAST | {"hold": 5.0, "stale_after": 5.0} | in_simulation)
        self.explorer = graph.add(Explorer, {"seed": 1, "object_frame_id": TRUTH_FRAME} | in_simulation | parameters)
        self._clock = graph.publisher(Clock, "/clock", qos.stream_publisher())
        self._tf = graph.publisher(TFMessage, "/tf", qos.TF)
        self._contact = graph.publisher(TactileContact, "tactile/contact", qos.stream_publisher())
        self._points = graph.publisher(PointCloud2, "tactile/points", qos.stage_publisher())
        self._enable = graph.publisher(Bool, "contact_controller/enable", qos.COMMAND)
        self._modes = graph.publisher(PoseModes, "pose_modes", qos.stream_publisher())
        self._filter = graph.companion.create_publisher(FilterStatus, "filter_status", qos.latched(100))
        mesh = object_mesh(f"file://{BALL}", Header(frame_id="object"))
        graph.publisher(MarkerArray, "object_mesh", latched=True).publish(mesh)
        self._twists = []
        graph.companion.create_subscription(TwistStamped, "delta_twist_cmds", self._on_twist, qos.stream_subscriber(10))
        self.statuses = graph.listen(ExplorerStatus, "explorer/status", latched=True)
        graph.companion.create_service(SuggestMotion, "suggest_motion", self._advise)
        self.suggestions = []

    def _advise(self, request, response):
        response.success, response.suggestions = True, self.suggestions
        return response

    def _on_twist(self, twist):
        linear, angular = twist.twist.linear, twist.twist.angular
        self._twists.append([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        self.arm.command(self._now * 1e-9, np.array(self._twists[-1]))

    def step(self):
        """Time goes on by one period of control, once the contact_controller has said what to do in it."""
        self._now += PERIOD_NS
        gel, stamp = self.arm.advance(self._now * 1e-9), stamp_from_ns(self._now)
        self._tf.publish(tf_msg(self._now, gel))
        self._tf.publish(tf_msg(self._now, OBJECT, child=TRUTH_FRAME))
        self._enable.publish(Bool(data=self.enabled))
        if self._steps % PER_IMAGE == 0:
            self._image(stamp, se3.inverse(OBJECT) @ gel)
        self._steps += 1
        before, late = len(self._twists), time.monotonic() + LATE
        self._clock.publish(Clock(clock=stamp))
        self.graph.spin_until(lambda: len(self._twists) > before or time.monotonic() > late, "a twist")

    def _image(self, stamp, on_object):
        contact = Contact.of(np.maximum(self._renderer.render(on_object[None])[0], 0), self._sensor)
        touches, gel = contact.area_m2 > LEAST_AREA, Header(stamp=stamp, frame_id=GEL_FRAME)
        area, depth = (contact.area_m2, contact.depth_m) if touches else (0.0, 0.0)
        points = cloud_from_penetration(contact.penetration, contact.penetration > 0, self._sensor)
        self._contact.publish(TactileContact(header=gel, in_contact=touches, area=float(area), depth=float(depth)))
        self._points.publish(points_to_msg(points if touches else np.zeros((0, 3)), gel))
        modes = PoseModes(header=Header(stamp=stamp, frame_id="object"), modes=[PoseMode(weight=1.0)])
        modes.modes[0].pose.pose = pose_to_msg(on_object)
        self._modes.publish(modes)
        self._filter.publish(FilterStatus(header=modes.header, state=self.state if touches else "no_contact"))

    def until(self, done, what):
        end = self._now + LONGEST_NS
        while not (self.statuses and done(self.statuses[-1])):
            assert self._now < end, f"{what}: {[one.reason for one in self.statuses]}"
            self.step()


@pytest.mark.slow
def test_it_slides_and_leaps_over_the_object_with_the_arm(graph):
    rig = Rig(graph)
    rig.suggestions = [Suggestion(heading=0.5, length=0.02, information=0.5, reason="a slide")]
    rig.until(lambda status: status.slides >= 1, "a slide")
    touched_at = rig.arm.pose.copy()
    rig.suggestions = [Suggestion(heading=2.0, length=0.04, lift=True, information=0.5, reason="a leap")]
    rig.until(lambda status: status.lifts >= 2, "a leap")
    assert np.linalg.norm(rig.arm.pose[:3, 3] - touched_at[:3, 3]) > 0.02
    rig.state = "converged"
    rig.until(lambda status: status.state == "known", "an end")
    assert not rig.explorer.gave_up


@pytest.mark.slow
def test_what_is_in_the_arms_way_is_the_reason_for_the_end(graph):
    rig = Rig(graph)
    rig.until(lambda status: status.state == "exploring", "the beginning")
    rig.enabled = False
    rig.until(lambda status: status.state == "gave_up", "an end")
    assert "not enabled" in rig.statuses[-1].reason
