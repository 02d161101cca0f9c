"""The explorer and a finger, with a stand-in for the filter, which answers each pose as an image of it."""

import numpy as np
from goals import Asked
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from midastouch_common.frames import GEL_FRAME, TRUTH_FRAME
from midastouch_common.message_arrays import stamp_ns, transform_from_msg
from midastouch_common.ros import qos
from midastouch_motion.nodes.explorer import Explorer
from midastouch_msgs.msg import ExplorerStatus, FilterStatus
from midastouch_msgs.srv import SuggestMotion
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.nodes.simulated_finger import SimulatedFingerNode

BALL, TOOL = (str(bundled_objects()[name]) for name in ("ball", "handle_tool"))
RADIUS = 0.03  # m
TOUCHING = RADIUS + 1e-3  # of the gel's apex from the centre


class AnsweredFinger:
    """A finger over the ball, and a filter that answers with `state` where it touches, else with `untouched`.

    Attributes: node; gels T_base_gel, objects T_base_obj and poses T_obj_gel (4, 4), and stamps [ns], of each image;
    silent, whether the filter is; reason and unknown, which it gives.
    """

    def __init__(self, graph, **parameters):
        self.graph, self.silent = graph, False
        self.state, self.untouched, self.reason = "ambiguous", FilterStatus.STATE_NO_CONTACT, ""
        self.unknown = 0.0
        self.poses, self.objects, self.gels, self.stamps = [], [], [], []
        self._answers = graph.companion.create_publisher(FilterStatus, "filter_status", qos.latched(100))
        graph.companion.create_subscription(TFMessage, "/tf", self._on_tf, qos.TF)
        self.node = graph.add(SimulatedFingerNode, {"mesh": BALL, "seed": 1, "untouched_frames": 1} | parameters)

    def _on_tf(self, message):
        frames = {one.child_frame_id: transform_from_msg(one.transform) for one in message.transforms}
        stamp = message.transforms[0].header.stamp
        self.poses.append(np.linalg.inv(frames[TRUTH_FRAME]) @ frames[GEL_FRAME])
        self.objects.append(frames[TRUTH_FRAME])
        self.gels.append(frames[GEL_FRAME])
        self.stamps.append(stamp_ns(stamp))
        if not self.silent:
            state = self.state if self.touches else self.untouched
            header = Header(stamp=stamp)
            self._answers.publish(FilterStatus(state=state, reason=self.reason, unknown=self.unknown, header=header))

    @property
    def touches(self):
        return np.linalg.norm(self.poses[-1][:3, 3]) < TOUCHING

    def more_images(self, count):
        """Spin until more than so many further images have come."""
        seen = len(self.poses)
        self.graph.spin_until(lambda: len(self.poses) > seen + count, "more images")

    def ask(self, kind, **goal):
        return Asked(self.graph.companion, self.graph.spin_until, kind, **goal)

    def do(self, kind, **goal):
        """The result of a goal."""
        return self.ask(kind, **goal).ended()


class Rig(AnsweredFinger):
    """The same with an explorer, which is its `node`. parameters: of the explorer; mesh and seed, of both."""

    def __init__(self, graph, **parameters):
        both = {name: parameters.pop(name, default) for name, default in (("mesh", BALL), ("seed", 1))}
        super().__init__(graph, **both)
        self.ended, self.asked = [], []
        self.node = graph.add(lambda **options: Explorer(lambda: self.ended.append(1), **options), both | parameters)
        self.statuses = graph.listen(ExplorerStatus, "explorer/status", latched=True)

    def advise(self, **answer):
        """Offer suggestions: a service that gives these fields of its response."""

        def on_request(request, response):
            self.asked.append(request)
            for name, value in answer.items():
                setattr(response, name, value)
            return response

        self.graph.companion.create_service(SuggestMotion, "suggest_motion", on_request)

    def until(self, state, words=""):
        statuses = self.statuses

        def is_there():
            return any(one.state == state and words in one.reason for one in statuses)

        self.graph.spin_until(is_there, f"explorer {state}: {words}")
        return next(one for one in statuses if one.state == state and words in one.reason)

    def loses_patience(self, clock, seconds):
        """Its last status, once it has given up; with each image the clock goes on by so many seconds."""

        def goes_on():
            clock.now = seconds * len(self.poses)
            return self.statuses and self.statuses[-1].state == "gave_up"

        self.graph.spin_until(goes_on, "an end")
        return self.statuses[-1]

    def call(self, name):
        return self.graph.call(Trigger, f"explorer/{name}", Trigger.Request())
