"""`tdn` and `tcn` driven by a lifecycle manager over DDS."""

from __future__ import annotations

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from perception_fakes import BACKGROUND, FakeTcn, image_msg, touched
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tdn_rig import REPLAY

from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import points_to_msg, stamp_from_ns
from midastouch_msgs.msg import TactileCode, TactileContact
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode

pytestmark = pytest.mark.dds
WAITING = {**REPLAY, "autostart": False}


def test_tdn_hears_images_while_it_is_active_only(graph, depth, background):
    graph.add(lambda **options: TdnNode(depth=depth, **options), {**WAITING, "background": background})
    contacts = graph.listen(TactileContact, "tactile/contact")
    images = graph.companion.create_publisher(Image, "image_raw", 10)
    for stamp in (SECOND, 2 * SECOND):
        assert graph.change_state("tdn", "configure")
        assert graph.companion.count_subscribers("image_raw") == 0
        assert graph.change_state("tdn", "activate")
        graph.spin_until(lambda: images.get_subscription_count() == 1, "the subscription")
        images.publish(image_msg(touched(100), stamp))
        graph.spin_until(lambda stamp=stamp: len(contacts) == stamp // SECOND, "the contact")
        assert graph.change_state("tdn", "deactivate")
        graph.spin_until(lambda: images.get_subscription_count() == 0, "its end")
        images.publish(image_msg(touched(100), stamp + 1))
        assert graph.change_state("tdn", "cleanup")
    assert depth.calls == 2


def test_tcn_hears_clouds_while_it_is_active_only(graph):
    graph.add(lambda **options: TcnNode(tcn=FakeTcn(), **options), WAITING)
    codes = graph.listen(TactileCode, "tactile/code")
    clouds = graph.companion.create_publisher(PointCloud2, "tactile/points", qos.stage_publisher())
    for count in (1, 2):
        assert graph.change_state("tcn", "configure")
        assert graph.companion.count_subscribers("tactile/points") == 0
        assert graph.change_state("tcn", "activate")
        graph.spin_until(lambda: clouds.get_subscription_count() == 1, "the subscription")
        clouds.publish(points_to_msg(np.zeros((0, 3)), Header(stamp=stamp_from_ns(count))))
        graph.spin_until(lambda count=count: codes and codes[-1].header.stamp.nanosec == count, "the code")
        assert graph.change_state("tcn", "deactivate")
        graph.spin_until(lambda: clouds.get_subscription_count() == 0, "its end")
        assert graph.change_state("tcn", "cleanup")


@pytest.mark.parametrize(("name", "node"), [("tdn", TdnNode), ("tcn", TcnNode)])
def test_a_missing_network_fails_the_transition_until_fixed(graph, name, node):
    graph.add(node, {**WAITING, name: "no_such_network"})
    statuses = graph.listen(DiagnosticArray, "/diagnostics")
    assert not graph.change_state(name, "configure")
    graph.spin_until(lambda: any("no_such_network" in s.message for m in statuses for s in m.status), "the reason")
    assert graph.state_of(name) == "unconfigured"
    assert graph.set_parameter(name, name, "fast").successful
    assert graph.change_state(name, "configure")
    assert graph.change_state(name, "activate")
    said = [s.message for m in statuses for s in m.status]
    kind = {"tdn": "depth", "tcn": "code"}[name]
    assert f"loading the {kind} network 'fast'" in said


def test_only_an_active_tdn_captures_and_one_that_stops_refuses(graph, depth, background):
    graph.add(lambda **options: TdnNode(depth=depth, **options), {**WAITING, "background": background})
    refused = graph.call(Trigger, "capture_background", Trigger.Request())
    assert not refused.success
    assert "ros2 lifecycle set" in refused.message

    assert graph.change_state("tdn", "configure")
    assert graph.change_state("tdn", "activate")
    images = graph.publisher(Image, "image_raw")
    client = graph.companion.create_client(Trigger, "capture_background")
    graph.spin_until(client.service_is_ready, "the service")
    answer = client.call_async(Trigger.Request())
    contacts = graph.listen(TactileContact, "tactile/contact")
    images.publish(image_msg(BACKGROUND, SECOND))
    graph.spin_until(lambda: contacts, "an image")
    assert graph.change_state("tdn", "deactivate")
    graph.spin_until(answer.done, "the answer")
    assert (answer.result().success, answer.result().message) == (False, "the node was deactivated")
