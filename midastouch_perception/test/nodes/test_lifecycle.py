"""`tdn` and `tcn` driven by a lifecycle manager over DDS."""

from __future__ import annotations

import pytest
from perception_fakes import BACKGROUND, image_msg
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger
from tdn_rig import REPLAY

from midastouch_msgs.msg import TactileContact
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode

pytestmark = pytest.mark.dds
WAITING = {**REPLAY, "autostart": False}


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
