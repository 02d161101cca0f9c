from __future__ import annotations

import types

import numpy as np
import pytest
from filter_fakes import DIAGONAL, pose_msg, translation

from midastouch_filter.nodes.start_topics import StartTopics
from midastouch_filter.transforms import TransformBuffer


class Topics:
    """Both topics on a node that only hands messages on; what they told the localiser, and what they refused."""

    def __init__(self):
        self.callbacks, self.starts, self.priors, self.bad = {}, [], [], []
        log = types.SimpleNamespace(info=lambda _: None)
        node = types.SimpleNamespace(create_subscription=self._subscribe, get_logger=lambda: log)
        localiser = types.SimpleNamespace(
            object=types.SimpleNamespace(diagonal=DIAGONAL),
            T_base_obj=lambda: translation(0.0, 0.2),
            start_at=self.starts.append,
            expect_object_at=lambda *prior: self.priors.append(prior),
        )
        known = TransformBuffer()
        known.insert("base_link", "camera", 0, translation(0.1), static=True)
        transforms = types.SimpleNamespace(newest=lambda target, source: known.lookup(target, source, 0))
        frames = {"base_frame_id": "base_link", "object_frame_id": "object"}
        StartTopics(node, frames, localiser, transforms, lambda *bad: self.bad.append(bad))

    def _subscribe(self, _type, topic, callback, _qos):
        self.callbacks[topic] = callback

    def send(self, topic: str, frame: str) -> None:
        self.callbacks[topic](pose_msg(frame, translation(0.0, 0.3)))


@pytest.fixture
def topics():
    return Topics()


@pytest.mark.parametrize("topic", ["initialpose", "object_pose_prior"])
@pytest.mark.parametrize("frame", ["", "/"])
def test_a_pose_in_no_frame_is_refused(topics, topic, frame):
    topics.send(topic, frame)
    ((kind, reason),) = topics.bad
    assert kind == f"bad_{topic}"
    assert "header.frame_id is empty" in reason
    assert not topics.starts + topics.priors


@pytest.mark.parametrize("frame", ["camera", "/camera"])
def test_poses_in_a_known_frame_are_taken(topics, frame):
    topics.send("initialpose", frame)
    topics.send("object_pose_prior", frame)
    assert not topics.bad
    np.testing.assert_allclose(topics.starts[0].pose, translation(0.1, 0.1))
    np.testing.assert_allclose(topics.priors[0][0], translation(0.1, 0.3))


@pytest.mark.parametrize(("frame", "place"), [("/object", (0.0, 0.3)), ("/base_link", (0.0, 0.1))])
def test_our_own_frames_need_no_transform(topics, frame, place):
    topics.send("initialpose", frame)
    assert not topics.bad
    np.testing.assert_allclose(topics.starts[0].pose, translation(*place))


@pytest.mark.parametrize("topic", ["initialpose", "object_pose_prior"])
def test_a_frame_that_nobody_names_is_refused(topics, topic):
    topics.send(topic, "moon")
    ((kind, reason),) = topics.bad
    assert kind == f"bad_{topic}"
    assert "moon" in reason
