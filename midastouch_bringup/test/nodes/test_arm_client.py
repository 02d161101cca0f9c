"""Whoever moves an arm by its actions, and goes, has it stop."""

import pytest
from rclpy.node import Node

from midastouch_bringup.bags.messages import BASE_FRAME
from midastouch_bringup.explore.acts import Slide
from midastouch_bringup.nodes.arm_actions import KINDS
from midastouch_bringup.nodes.arm_client import ArmClient
from midastouch_common.ros.goals import GoalServer, end_goal, name_of

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
