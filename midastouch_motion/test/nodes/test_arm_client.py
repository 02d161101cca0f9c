"""Whoever moves an arm by its actions, and goes, has it stop."""

from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future

from midastouch_common import se3
from midastouch_common.frames import BASE_FRAME
from midastouch_common.ros.conversions import stamped_pose
from midastouch_common.ros.goals import GoalServer, end_goal, name_of
from midastouch_motion.exploration.acts import Approach, Lift, Slide, Touch
from midastouch_motion.nodes import arm_client
from midastouch_motion.nodes.arm_actions import KINDS, act_of, done_of, goal_of
from midastouch_motion.nodes.arm_client import ArmClient

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


@pytest.mark.parametrize("arrives", [True, False])
def test_a_goal_whose_answer_is_lost_is_asked_for_its_result(graph, arm, monkeypatch, arrives):
    """As in the first second of a network; or the goal itself is."""
    monkeypatch.setattr(arm_client, "ANSWER_S", 0.1)
    send, answer = ActionClient.send_goal_async, Future()

    def lost(client, goal, *others):
        if arrives:
            send(client, goal, *others)
        return answer

    monkeypatch.setattr(ActionClient, "send_goal_async", lost)
    ended = []
    client = ArmClient(graph.add(Node, node_name="mover"), BASE_FRAME, ended.append)
    graph.spin_until(lambda: not client.trouble, "the actions")
    client.carry_out(Slide(0.0, 0.1))
    if arrives:
        graph.spin_until(lambda: arm.goals, "the goal")
        end_goal(arm.goals[0], True, KINDS[Slide].Result(success=True, path=0.1))
    graph.spin_until(lambda: client.look() or ended, "the end of the act")
    assert [each and each.path for each in ended] == [0.1 if arrives else None]
    monkeypatch.undo()
    client.carry_out(Lift(0.01))
    answer.set_result(SimpleNamespace(accepted=False))  # too late, and not of this goal
    graph.spin_until(lambda: len(arm.goals) == 1 + arrives, "the next goal")
    end_goal(arm.goals[-1], True, KINDS[Lift].Result(success=True, path=0.01))
    graph.spin_until(lambda: len(ended) == 2, "its end")
    assert ended[1].path == 0.01
    client.close()


@pytest.mark.parametrize("act", [Touch(0.05, (0.0, 1.0, -1.0)), Slide(0.3, 0.02), Lift(0.01)])
def test_the_goal_of_an_act_asks_for_that_act(act):
    assert act_of(goal_of(act, BASE_FRAME), BASE_FRAME) == act


def test_the_goal_of_an_approach_asks_for_its_pose():
    pose = se3.exp(np.array([0.1, 0.2, 0.3, 0.1, 0.2, 0.3]))
    np.testing.assert_allclose(act_of(goal_of(Approach(pose), BASE_FRAME), BASE_FRAME).pose, pose)


@pytest.mark.parametrize(("frame", "counts"), [(BASE_FRAME, True), ("map", False), ("", False)])
def test_where_an_act_ended_counts_in_the_base_frame_only(frame, counts):
    there, seen = se3.translation([0.1, 0.0, 0.0]), np.eye(4)
    result = KINDS[Slide].Result(success=True, path=np.nan, pose=stamped_pose(frame, there))
    done = done_of(result, BASE_FRAME, True, seen)
    np.testing.assert_allclose(done.pose, there if counts else seen)
    assert done.path == 0.0
