"""Whoever moves an arm by its actions, and goes, has it stop."""

import pytest
from process_rig import processes
from rclpy.node import Node

from midastouch_bringup.bags.messages import BASE_FRAME
from midastouch_bringup.explore.acts import Slide
from midastouch_bringup.nodes.arm_actions import KINDS
from midastouch_bringup.nodes.arm_client import ArmClient
from midastouch_common.ros import qos
from midastouch_common.ros.goals import GoalServer, end_goal, name_of
from midastouch_msgs.msg import FilterStatus

pytestmark = pytest.mark.dds


class Arm:
    """Offers the actions, and carries out a goal until it is cancelled. Attributes: goals; cancelled, of these."""

    def __init__(self, graph):
        self.goals, self.cancelled = [], []
        servers = [
            GoalServer(graph.companion, kind, name_of(kind), self.goals.append, self._cancel) for kind in KINDS.values()
        ]
        self.close = lambda: [server.close() for server in servers]

    def _cancel(self, goal):
        self.cancelled.append(goal)
        end_goal(goal, False, KINDS[Slide].Result())


@pytest.fixture
def arm(graph):
    arm = Arm(graph)
    yield arm
    arm.close()


@pytest.mark.parametrize("begun", [False, True])
def test_a_goal_in_flight_is_cancelled(graph, arm, begun):
    node = graph.add(Node, node_name="mover")
    client = ArmClient(node, BASE_FRAME, lambda result: None)
    graph.spin_until(lambda: not client.trouble, "the actions")
    client.carry_out(Slide(0.0, 0.1))
    graph.spin_until(lambda: arm.goals or not begun, "the goal")
    client.close()
    graph.remove(node)
    graph.spin_until(lambda: arm.cancelled, "the goal to be cancelled")


def test_an_explorer_that_is_ended_has_the_arm_stop(graph, arm, tmp_path):
    answers = graph.companion.create_publisher(FilterStatus, "filter_status", qos.latched())
    with processes({"explorer": ["-m", "midastouch_bringup.nodes.explorer"]}, {"explorer": {}}, tmp_path):

        def is_asked():
            answers.publish(FilterStatus(state=FilterStatus.STATE_NO_CONTACT))
            return arm.goals

        graph.spin_until(is_asked, "a motion")
    graph.spin_until(lambda: arm.cancelled, "it to be cancelled")
