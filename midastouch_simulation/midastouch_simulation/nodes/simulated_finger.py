"""Node `simulated_finger`: an arm without mechanics touches a simulated object, by the actions of a real arm."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.frames import GEL_FRAME, TRUTH_GEL_FRAME
from midastouch_common.ros import diagnostics, qos, spin
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.conversions import stamp_from_ns, stamped_pose
from midastouch_common.ros.goals import GoalServer, end_goal, name_of
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_common.ros.services import offer
from midastouch_motion.exploration.acts import Done
from midastouch_motion.nodes.arm_actions import KINDS, act_of
from midastouch_msgs.msg import FilterStatus
from midastouch_msgs.srv import SetObject
from midastouch_perception.sensor_model import SensorModel

from ..world import World
from . import pace

PARAMETERS = (
    *pace.PARAMETERS,
    Parameter("speed", 0.05, "Of the finger on the surface", "m/s", minimum=1e-3, maximum=0.3),
    Parameter("sensor_frame_id", GEL_FRAME, "Gel frame, as of digit_sim"),
)

_UNTOUCHED = (FilterStatus.STATE_NO_CONTACT, FilterStatus.STATE_UNINITIALISED)


@dataclass
class _Motion:
    """Motion; poses: yields one pose per image and returns how it ended; goal: that it belongs to, None if to none."""

    poses: Generator[np.ndarray, None, Done | None]
    goal: ServerGoalHandle | None = None
    kind: type[Any] | None = None
    path: float = 0.0
    over: bool = False
    done: Done | None = None


class SimulatedFingerNode(PipelineNode):
    """Node that carries out one goal of `touch`, `slide`, `lift` or `approach` at a time, at the pace of the filter.

    A goal ends once the filter has answered the images of its motion. `~/push` moves the object, `~/set_object`
    replaces it.
    """

    _servers: Sequence[GoalServer] = ()

    def __init__(self, **node_options) -> None:
        super().__init__("simulated_finger", **node_options)
        settings = self._settings = Parameters(self, PARAMETERS)
        sensor, rng = SensorModel.load(settings["sensor_model"]), np.random.default_rng(settings["seed"])
        self._world = World(load_mesh(settings["mesh"]), sensor, rng, settings["speed"] / settings["fps"])
        self._motions: deque[_Motion] = deque()
        self._untouched, self._ended = 0, ""
        frames = {name: settings[f"{name}_frame_id"] for name in ("base", "object", "sensor")}
        self._frames, self._pace = frames, pace.Pace(self, settings["fps"])
        diagnostics.Diagnostics(self, self._describe)
        self.create_subscription(FilterStatus, "filter_status", self._on_filter, qos.latched(depth=100))
        offer(self, Trigger, "~/push", self._on_push)
        offer(self, SetObject, "~/set_object", self._on_set_object)
        self._servers = [
            GoalServer(self, kind, name_of(kind), partial(self._on_goal, kind=kind), self._on_cancel)
            for kind in KINDS.values()
        ]
        self.create_timer(1 / settings["fps"], self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def destroy_node(self) -> None:
        """Stop offering the actions, then destroy the node."""
        for server in self._servers:
            server.close()
        super().destroy_node()

    @property
    def _ready(self) -> bool:
        """True after enough untouched images: `tdn` would learn an earlier contact as part of the background."""
        return self._untouched >= self._settings["untouched_frames"]

    def _describe(self) -> tuple[bytes, str, dict]:
        going = next((name_of(one.kind) for one in self._motions if one.kind), "none")
        values = {"motion": going, "last_motion": self._ended, "awaited": len(self._pace.awaited)}
        return diagnostics.OK, "" if self._ready else "it waits for images of the untouched sensor", values

    # --- images

    def _look(self) -> None:
        """Publish another image while nothing moves, so that a lost answer is not awaited for ever."""
        if not self._ready or self._pace.at_rest:
            self._publish()

    def _publish(self) -> None:
        """Publish finger and object as they are now."""
        world, frames = self._world, self._frames
        self._pace.publish(
            (
                (frames["base"], frames["object"], world.base_from_object),
                (frames["base"], frames["sensor"], world.base_from_gel),
                (frames["object"], TRUTH_GEL_FRAME, world.finger.pose),
            )
        )

    def _on_filter(self, status: FilterStatus) -> None:
        if not self._pace.answered(status):
            return
        # a filter that does not know the object yet does not report contact, which counts as untouched
        self._untouched += not self._ready and status.state in _UNTOUCHED
        self._go_on()

    def _go_on(self) -> None:
        """Publish the next poses as far as the filter has followed; after the last one begin the next motion."""
        while self._ready and self._motions:
            motion = self._motions[0]
            while not motion.over and self._pace.free:
                self._step(motion)
            if not motion.over or self._pace.awaited:
                return
            self._motions.popleft()
            if motion.goal is not None:
                self._end(motion.goal, motion.kind, motion.done)

    def _step(self, motion: _Motion) -> None:
        before = self._world.finger.pose[:3, 3]
        try:
            pose = next(motion.poses)
        except StopIteration as end:
            motion.over, motion.done = True, end.value
            return
        self._publish()
        motion.path += float(np.linalg.norm(pose[:3, 3] - before))
        if motion.goal is not None:
            header = Header(stamp=stamp_from_ns(self._pace.stamp), frame_id=self._frames["sensor"])
            depth = self._world.finger.depth
            motion.goal.publish_feedback(motion.kind.Feedback(header=header, path=motion.path, depth=depth))

    # --- goals

    def _on_goal(self, goal: ServerGoalHandle, kind: type[Any]) -> None:
        try:
            if other := next((one for one in self._motions if one.goal is not None), None):
                raise InputError(f"the finger is carrying out a {name_of(other.kind)}; cancel it first")
            act = act_of(goal.request, self._frames["base"])
        except InputError as error:
            self._end(goal, kind, self._refusal(str(error)))
            return
        self._motions.append(_Motion(self._world.carry_out(act), goal, kind))
        self._go_on()

    def _on_cancel(self, goal: ServerGoalHandle) -> None:
        for motion in [one for one in self._motions if one.goal is goal]:
            self._motions.remove(motion)
            self._end(goal, motion.kind, self._refusal("cancelled", motion.path))

    def _refusal(self, why: str, path: float = 0.0) -> Done:
        return Done(False, why, path, self._world.finger.touching, self._world.base_from_gel)

    def _end(self, goal: ServerGoalHandle, kind: type[Any], done: Done) -> None:
        self._ended = done.message
        self.get_logger().info(f"{name_of(kind)}: {done.message}")
        end_goal(goal, done.success, self._result(kind, done))

    def _result(self, kind: type[Any], done: Done) -> Any:
        pose = stamped_pose(self._frames["base"], done.pose, stamp_from_ns(self._pace.stamp))
        depth = self._world.finger.depth
        return kind.Result(success=done.success, message=done.message, path=done.path, depth=depth, pose=pose)

    # --- the object

    def _on_push(self, _: Trigger.Request) -> None:
        """Push the object after the motions that are already asked for, and before any later one."""
        self._motions.append(_Motion(self._world.push()))
        self._go_on()

    def _on_set_object(self, request: SetObject.Request) -> None:
        if self._motions:
            raise InputError("the finger is moving")
        self._world.put(load_mesh(request.mesh_path))


def main(args: list[str] | None = None) -> int:
    """Entry point of the executable `simulated_finger`."""
    return spin.run(lambda: [SimulatedFingerNode()], args)


if __name__ == "__main__":
    sys.exit(main())
