"""Node `detection_prior`: passes the pose of the object that a camera detects to the filter, as a start.

Detectors of 6-DoF poses (Isaac ROS FoundationPose, for one) publish `vision_msgs/Detection3DArray` many times a
second, and a start makes the filter forget its measurements. So detections are passed on only while the filter
is uninitialised or lost, or when you ask for it.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger
from vision_msgs.msg import Detection3DArray

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import covariance_from_msg, pose_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.diagnostics import OK, Diagnostics
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.services import offer
from midastouch_common.ros.spin import run
from midastouch_msgs.msg import FilterStatus

PARAMETERS = (
    Parameter("class_id", "", "Class that the detector gives the object; empty: any", read_only=False),
    Parameter("min_score", 0.5, "Lowest score at which a detection is used", minimum=0.0, read_only=False),
    Parameter(
        "sigma_translation",
        0.01,
        "Spread where the detector gives no covariance",
        "m",
        minimum=5e-4,
        maximum=1.0,
        read_only=False,
    ),
    Parameter("sigma_rotation", 0.2, "As sigma_translation", "rad", minimum=0.02, maximum=3.2, read_only=False),
    Parameter("when_lost", True, "Restart the filter while it is lost", read_only=False),
    Parameter("period", 1.0, "Least time between two starts", "s", minimum=0.0, maximum=3600.0, read_only=False),
)


class DetectionPrior(PipelineNode):
    """Node that subscribes to `detections` and `filter_status`, publishes `object_pose_prior` and offers `~/send`.

    The pose of the best hypothesis of the class is passed on, in the detection's frame, while the filter is
    uninitialised or lost, and once after `~/send`. Variances of zero, which mean "not known" in both messages, are
    replaced by those of the parameters.
    """

    def __init__(self, **kwargs):
        super().__init__("detection_prior", **kwargs)
        self._settings = Parameters(self, PARAMETERS)
        self._state, self._asked, self._sent, self._last = "", False, 0, -np.inf
        self._out = self.create_publisher(PoseWithCovarianceStamped, "object_pose_prior", qos.COMMAND)
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched())
        self.create_subscription(Detection3DArray, "detections", self._on_detections, qos.stream_subscriber())
        offer(self, Trigger, "~/send", self._on_send)

    def _on_status(self, msg: FilterStatus) -> None:
        if msg.state != FilterStatus.STATE_WAITING:
            self._state = msg.state

    def _on_send(self, _: Trigger.Request) -> str:
        self._asked = True
        return "the next detection of the object starts the filter"

    def _on_detections(self, msg: Detection3DArray) -> None:
        if not self._is_wanted():
            return
        prior = self._best(msg)
        if prior is None:
            return
        try:
            pose_from_msg(prior.pose.pose)
            covariance_from_msg(prior.pose.covariance)
        except InputError as error:
            self._diagnostics.problem("bad_detections", f"detections: {error}")
            return
        self._out.publish(prior)
        self._asked, self._last, self._sent = False, time.monotonic(), self._sent + 1

    def _is_wanted(self) -> bool:
        if self._asked:
            return True
        knows_nothing = self._state == FilterStatus.STATE_UNINITIALISED
        lost = self._state == FilterStatus.STATE_LOST and self._settings["when_lost"]
        return (knows_nothing or lost) and time.monotonic() - self._last >= self._settings["period"]

    def _best(self, msg: Detection3DArray) -> PoseWithCovarianceStamped | None:
        """The most likely hypothesis of the object's class; None if there is none good enough."""
        wanted = self._settings["class_id"]
        candidates = [
            (result, detection.header.frame_id)
            for detection in msg.detections
            for result in detection.results
            if wanted in ("", result.hypothesis.class_id) and result.hypothesis.score >= self._settings["min_score"]
        ]
        if not candidates:
            return None
        best, frame = max(candidates, key=lambda candidate: candidate[0].hypothesis.score)
        prior = PoseWithCovarianceStamped(header=msg.header, pose=best.pose)
        prior.header.frame_id = frame or msg.header.frame_id
        covariance = np.array(best.pose.covariance).reshape(6, 6)
        for axis, sigma in enumerate(
            [self._settings["sigma_translation"]] * 3 + [self._settings["sigma_rotation"]] * 3
        ):
            if covariance[axis, axis] == 0.0:
                covariance[axis, axis] = sigma**2
        prior.pose.covariance = covariance.ravel()
        return prior

    def _describe(self) -> tuple[bytes, str, dict]:
        return OK, f"filter: {self._state or 'no filter_status yet'}", {"sent": self._sent}


def main() -> int:
    """Entry point of the executable."""
    return run(lambda: [DetectionPrior()])


if __name__ == "__main__":
    sys.exit(main())
