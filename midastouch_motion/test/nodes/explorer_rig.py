"""The explorer and a finger, with a stand-in for the filter, which answers each pose as an image of it."""

import numpy as np
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from midastouch_common.frames import GEL_FRAME, TRUTH_FRAME
from midastouch_common.message_arrays import transform_from_msg
from midastouch_common.ros import qos
from midastouch_motion.nodes.explorer import Explorer
from midastouch_msgs.msg import ExplorerStatus, FilterStatus
from midastouch_msgs.srv import SuggestMotion
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.nodes.simulated_finger import SimulatedFingerNode

BALL, TOOL = (str(bundled_objects()[name]) for name in ("ball", "handle_tool"))
RADIUS = 0.03  # m
TOUCHING = RADIUS + 1e-3  # of the gel's apex from the centre


class Rig:
    """An explorer, a finger over the ball, and a filter that answers with `state` where the finger touches.

    parameters: of the explorer, but for those in `of_finger`, mesh and seed, which both have.
    """

    def __init__(self, graph, of_finger=None, **parameters):
        self.graph, self.state, self.silent, self.ended = graph, "ambiguous", False, []
        self.reason = ""
        self.untouched = FilterStatus.STATE_NO_CONTACT
        self.poses, self.objects, self.gels, self.asked = [], [], [], []
        self._answers = graph.companion.create_publisher(FilterStatus, "filter_status", qos.latched(100))
        graph.companion.create_subscription(TFMessage, "/tf", self._on_tf, qos.TF)
        both = {name: parameters.pop(name, default) for name, default in (("mesh", BALL), ("seed", 1))}
        self.finger = graph.add(SimulatedFingerNode, {"untouched_frames": 1} | both | (of_finger or {}))
        self.node = graph.add(lambda **options: Explorer(lambda: self.ended.append(1), **options), both | parameters)
        self.statuses = graph.listen(ExplorerStatus, "explorer/status", latched=True)

    def _on_tf(self, message):
        frames = {one.child_frame_id: transform_from_msg(one.transform) for one in message.transforms}
        stamp = message.transforms[0].header.stamp
        self.poses.append(np.linalg.inv(frames[TRUTH_FRAME]) @ frames[GEL_FRAME])
        self.objects.append(frames[TRUTH_FRAME])
        self.gels.append(frames[GEL_FRAME])
        touches = np.linalg.norm(self.poses[-1][:3, 3]) < TOUCHING
        if not self.silent:
            status = FilterStatus(state=self.state if touches else self.untouched, reason=self.reason)
            status.header.stamp = stamp
            self._answers.publish(status)

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

    def call(self, name):
        return self.graph.call(Trigger, f"explorer/{name}", Trigger.Request())
