import pytest
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import String

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_common.ros.node import PipelineNode

pytestmark = pytest.mark.dds


class Talker(PipelineNode):
    def __init__(self, **options):
        super().__init__("talker", **options)
        self.create_publisher(String, "talk", qos.COMMAND)
        self.create_subscription(String, "hear", lambda msg: None, qos.COMMAND)


def profiles(graph) -> dict[str, ReliabilityPolicy]:
    """Reliability by kind of end."""
    node = graph.companion
    found = [*node.get_publishers_info_by_topic("talk"), *node.get_subscriptions_info_by_topic("hear")]
    return {info.endpoint_type.name: info.qos_profile.reliability for info in found}


def test_qos_can_be_overridden_for_one_topic_alone(graph):
    graph.add(Talker, {"qos_overrides./talk.publisher.reliability": "best_effort"})
    graph.spin_until(lambda: len(profiles(graph)) == 2, "both ends")
    assert profiles(graph) == {"PUBLISHER": ReliabilityPolicy.BEST_EFFORT, "SUBSCRIPTION": ReliabilityPolicy.RELIABLE}
    assert qos.COMMAND.reliability is ReliabilityPolicy.RELIABLE, "the shared profile is as it was"


@pytest.mark.parametrize("value", ["sometimes", 3])
def test_what_is_no_policy_is_refused(graph, value):
    with pytest.raises(InputError, match="talker: qos_overrides of talk: "):
        graph.add(Talker, {"qos_overrides./talk.publisher.reliability": value})
