"""`tdn` and `tcn` driven by a lifecycle manager over DDS."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from perception_fakes import BACKGROUND, FakeDepthStage, FakeTcn, image_msg
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tdn_rig import REPLAY

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import points_to_msg, stamp_from_ns
from midastouch_msgs.msg import TactileCode, TactileContact
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode

pytestmark = pytest.mark.dds
WAITING = {**REPLAY, "autostart": False}


def empty_cloud(stamp: int) -> PointCloud2:
    return points_to_msg(np.zeros((0, 3)), Header(stamp=stamp_from_ns(stamp)))


STAGES = {
    "tdn": (functools.partial(TdnNode, depth=FakeDepthStage()), "image_raw", functools.partial(image_msg, BACKGROUND)),
    "tcn": (functools.partial(TcnNode, tcn=FakeTcn()), "tactile/points", empty_cloud),
}
ANSWERS = {"tdn": (TactileContact, "tactile/contact"), "tcn": (TactileCode, "tactile/code")}


@pytest.mark.parametrize("name", STAGES)
def test_a_node_hears_while_it_is_active_only(graph, name):
    make, topic, message = STAGES[name]
    graph.add(make, WAITING)
    answered = graph.listen(*ANSWERS[name])
    publisher = graph.companion.create_publisher(type(message(0)), topic, qos.stage_publisher())
    for stamp in (1, 2):
        assert graph.change_state(name, "configure")
        assert graph.companion.count_subscribers(topic) == 0
        assert graph.change_state(name, "activate")
        graph.spin_until(lambda: publisher.get_subscription_count() == 1, "the subscription")
        publisher.publish(message(stamp))
        graph.spin_until(lambda stamp=stamp: answered and stamp_ns(answered[-1].header.stamp) == stamp, "the answer")
        assert graph.change_state(name, "deactivate")
        graph.spin_until(lambda: publisher.get_subscription_count() == 0, "its end")
        assert graph.change_state(name, "cleanup")


@pytest.mark.parametrize(("name", "node"), [("tdn", TdnNode), ("tcn", TcnNode)])
def test_a_missing_network_fails_the_transition_until_fixed(graph, name, node):
    graph.add(node, {**WAITING, name: "no_such_network"})
    health = graph.health()
    assert not graph.change_state(name, "configure")
    health.until("no_such_network")
    assert graph.state_of(name) == "unconfigured"
    assert graph.set_parameter(name, name, "fast").successful
    assert graph.change_state(name, "configure")
    assert graph.change_state(name, "activate")
    kind = {"tdn": "depth", "tcn": "code"}[name]
    assert health.says(f"loading the {kind} network 'fast'")


def test_only_an_active_tdn_captures_and_one_that_stops_refuses(graph, depth, background):
    graph.add(lambda **options: TdnNode(depth=depth, **options), {**WAITING, "background": background})
    refused = graph.call(Trigger, "capture_background", Trigger.Request())
    assert not refused.success
    assert "ros2 lifecycle set" in refused.message

    assert graph.change_state("tdn", "configure")
    assert graph.change_state("tdn", "activate")
    images = graph.publisher(Image, "image_raw")
    answer = graph.request(Trigger, "capture_background", Trigger.Request())
    contacts = graph.listen(TactileContact, "tactile/contact")
    images.publish(image_msg(BACKGROUND, 1))
    graph.spin_until(lambda: contacts, "an image")
    assert graph.change_state("tdn", "deactivate")
    graph.spin_until(answer.done, "the answer")
    assert (answer.result().success, answer.result().message) == (False, "the node was deactivated")
