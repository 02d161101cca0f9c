import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesisWithPose

from midastouch_filter.nodes.detection_prior import DetectionPrior
from midastouch_msgs.msg import FilterStatus

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]


def hypothesis(x: float, class_id: str = "mug", score: float = 0.9, variance: float = 0.0) -> ObjectHypothesisWithPose:
    result = ObjectHypothesisWithPose()
    result.hypothesis.class_id, result.hypothesis.score = class_id, score
    result.pose.pose.position.x = x
    result.pose.covariance = np.diag([variance] * 6).ravel()
    return result


def detections(*results: ObjectHypothesisWithPose, frame: str = "") -> Detection3DArray:
    msg = Detection3DArray(detections=[Detection3D(results=[result]) for result in results])
    msg.header.frame_id, msg.header.stamp.sec = "camera", 7
    for one in msg.detections:
        one.header.frame_id = frame
    return msg


class Bench:
    """The node, a detector, a filter that says what it knows, and the starts that were sent."""

    def __init__(self, graph, **parameters):
        self.graph = graph
        self.node = graph.add(DetectionPrior, {"period": 0.0, **parameters})
        self.detector = graph.publisher(Detection3DArray, "detections")
        self.filter = graph.publisher(FilterStatus, "filter_status", latched=True)
        self.priors = graph.listen(PoseWithCovarianceStamped, "object_pose_prior")
        self.health = graph.health()
        self._seen, self._sent = [], []
        (subscription,) = (s for s in self.node.subscriptions if s.topic_name == "/detections")
        (publisher,) = (p for p in self.node.publishers if p.topic_name == "/object_pose_prior")
        on_message, publish = subscription.callback, publisher.publish
        subscription.callback = lambda msg: (on_message(msg), self._seen.append(msg))
        publisher.publish = lambda msg: (publish(msg), self._sent.append(msg))

    def state(self, state: str) -> None:
        """Let the filter say its state, and the node hear it."""
        self.health.clear()
        self.filter.publish(FilterStatus(state=state))
        self.health.until(f"filter: {state}")

    def sees(self, msg: Detection3DArray) -> PoseWithCovarianceStamped:
        """The start that a message of the detector leads to."""
        before = len(self.priors)
        self.detector.publish(msg)
        self.graph.spin_until(lambda: len(self.priors) > before, "a start")
        return self.priors[-1]

    def overlooks(self, *messages: Detection3DArray) -> None:
        """None of the messages, once the node has seen them, leads to a start."""
        sent = len(self._sent)
        for msg in messages:
            self._seen.clear()
            self.detector.publish(msg)
            self.graph.spin_until(lambda: self._seen, "the message in the node")
        assert len(self._sent) == sent


def test_a_filter_that_waits_knows_as_much_as_before(graph):
    bench = Bench(graph)
    bench.state("uninitialised")
    bench.filter.publish(FilterStatus(state="waiting"))
    bench.sees(detections(hypothesis(0.3, score=0.8)))
    bench.state("converged")
    bench.filter.publish(FilterStatus(state="waiting"))
    bench.overlooks(detections(hypothesis(0.3, score=0.8)))


def test_the_best_detection_of_the_object_is_the_start(graph):
    bench = Bench(graph, class_id="mug", sigma_translation=0.02, sigma_rotation=0.1)
    bench.state("uninitialised")
    best, other = hypothesis(0.3, score=0.8), hypothesis(0.1, "cup", score=0.95)
    prior = bench.sees(detections(hypothesis(0.2, score=0.7), best, other))
    assert (prior.pose.pose.position.x, prior.header.frame_id, prior.header.stamp.sec) == (0.3, "camera", 7)
    variances = np.diagonal(np.array(prior.pose.covariance).reshape(6, 6))
    np.testing.assert_allclose(variances, [4e-4] * 3 + [1e-2] * 3)


def test_a_detectors_own_frame_and_covariance_count(graph):
    bench = Bench(graph)
    bench.state("uninitialised")
    prior = bench.sees(detections(hypothesis(0.3, variance=0.09), frame="other_camera"))
    assert prior.header.frame_id == "other_camera"
    np.testing.assert_allclose(np.array(prior.pose.covariance).reshape(6, 6), 0.09 * np.eye(6))


def test_what_is_not_the_object_or_not_sure_is_overlooked(graph):
    bench = Bench(graph, class_id="mug", min_score=0.6)
    bench.state("uninitialised")
    bench.overlooks(detections(), detections(hypothesis(0.1, "cup")), detections(hypothesis(0.1, score=0.5)))
    assert bench.sees(detections(hypothesis(0.2))).pose.pose.position.x == 0.2


def test_a_filter_that_knows_anything_is_left_alone_unless_asked(graph):
    bench = Bench(graph)
    bench.overlooks(detections(hypothesis(0.1)))  # no filter has said anything yet
    for state in ("ambiguous", "converged", "no_contact", "stale"):
        bench.state(state)
        bench.overlooks(detections(hypothesis(0.1)))
    assert graph.call(Trigger, "detection_prior/send", Trigger.Request()).success
    assert bench.sees(detections(hypothesis(0.2))).pose.pose.position.x == 0.2
    bench.overlooks(detections(hypothesis(0.3)))


@pytest.mark.parametrize("when_lost", [True, False])
def test_a_lost_filter_is_helped_if_wanted(graph, when_lost):
    bench = Bench(graph, when_lost=when_lost)
    bench.state("lost")
    if when_lost:
        bench.sees(detections(hypothesis(0.1)))
    else:
        bench.overlooks(detections(hypothesis(0.1)))


def test_a_fast_detector_starts_the_filter_only_now_and_then(graph):
    bench = Bench(graph, period=3600.0)
    bench.state("uninitialised")
    bench.sees(detections(hypothesis(0.1)))
    bench.overlooks(*[detections(hypothesis(0.1))] * 3)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_poses_that_are_none_are_refused_and_said(graph, value):
    bench = Bench(graph)
    bench.state("uninitialised")
    bench.overlooks(detections(hypothesis(value)), detections(hypothesis(0.1, variance=value)))
    bench.health.until("detections: ")
    assert bench.sees(detections(hypothesis(0.2))).pose.pose.position.x == 0.2
