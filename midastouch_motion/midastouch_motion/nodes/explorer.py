"""Node `explorer`: decides where an arm slides and touches until the filter knows the pose of an object."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import spin
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameters
from midastouch_filter.active_touch.suggestion import Advice
from midastouch_msgs.msg import ExplorerStatus, FilterStatus

from ..exploration.acts import CheckReach, Done, Plan
from ..exploration.exploration import Exploration
from ..exploration.reach import Reach
from .arm_actions import done_of
from .arm_client import ArmClient
from .explorer_control import ExplorerControl, FingerGoals, Order
from .explorer_marker import FingerMarker
from .explorer_parameters import PARAMETERS
from .explorer_report import ExplorerReport
from .explorer_services import AdviceClient, ObjectChange, Push, ReachClient
from .explorer_sight import Sight
from .newest_answer import NewestAnswer

_RATE = 30.0  # Hz, of the checks for overdue answers


class Explorer(PipelineNode):
    """Node that moves an arm by the actions `touch`, `slide`, `lift` and `approach`, one motion after the other.

    It asks `suggest_motion` where to touch next, and moves at random while that is not offered or nothing touches.
    `on_end` is called once the exploration is over; `gave_up` is True if it ended without knowing the pose. If you call
    one of its services, or show it a point, the finger is yours until `~/resume`.
    """

    _arm: ArmClient | None = None
    _sight: Sight | None = None

    def __init__(self, on_end: Callable[[], None] = lambda: None, **kwargs) -> None:
        super().__init__("explorer", **kwargs)
        p = self._settings = Parameters(self, PARAMETERS)
        reach = Reach(p["reach_low"], p["reach_high"], p["max_tilt"], bool(p["reach_service"]))
        rng = np.random.default_rng(p["seed"])
        what = rng, p["max_path"], reach, p["touch_distance"], p["object_size"]
        self._exploration = Exploration(*what, held=lambda: self._report.state == ExplorerStatus.STATE_PAUSED)
        self._on_end, self._progressed_at = on_end, time.monotonic()
        self.gave_up, self._begun, self._held = False, False, p["start_paused"]
        self._plan: Plan | None = None
        self._unjudged = False  # True if the arm has acted since the last judgement
        self._moved_until = 0  # ns: answers to earlier images are not about the gel's present pose
        self._orders: deque[Order] = deque()

        frames = {name: p[f"{name}_frame_id"] for name in ("base", "object", "sensor")}
        self._report = ExplorerReport(self, self._exploration, frames["base"], frames["object"])
        problem = self._report.problem
        self._reach = ReachClient(self, p["reach_service"], frames["base"], self._on_reach, problem)
        self._arm = ArmClient(self, frames["base"], self._on_done)
        self._sight = Sight(self, frames, self._on_jump, problem)
        self._filter = NewestAnswer(self, lambda: self._sight.stamp, self._on_filter)
        self._suggestions = AdviceClient(self, p["max_motion"], self._on_advice)
        self._change = ObjectChange(self, self._on_object_changed)
        did, sight, push = self._exploration, self._sight, Push(self, problem)
        control = ExplorerControl(self, did, sight, self._take, self._resume, push, self._change)
        FingerMarker(self, sight, FingerGoals(self, did, sight, self._take, problem).send, control.commands, problem)
        self._show(load_mesh(p["mesh"]) if p["mesh"] else None)
        self.create_timer(1 / _RATE, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def destroy_node(self) -> None:
        """Stop the arm, then destroy the node."""
        for part in (self._arm, self._sight):
            if part is not None:
                part.close()
        super().destroy_node()

    # --- answers of the filter

    def _look(self) -> None:
        """Stop waiting for answers that are overdue."""
        now = time.monotonic()
        if self._report.over:
            return
        if (silent := now - self._filter.heard_at) > self._settings["give_up_after"]:
            whose = "of set_object" if self._change.pending else "on filter_status"
            self._fail(f"no answer {whose} for {silent:.0f} s: do sensor, arm and localisation run?")
            return
        by_itself = self._report.state in (ExplorerStatus.STATE_WAITING, ExplorerStatus.STATE_EXPLORING)
        if not (by_itself or self._plan) or self._change.pending or not self._filter.state:
            self._progressed_at = now
        if (stuck := now - max(self._progressed_at, self._arm.heard_at)) > self._settings["give_up_after"]:
            self._fail(f"the finger could not move for {stuck:.0f} s", self._filter.says)
            return
        for asked in (self._arm, self._suggestions, self._reach, self._change):
            asked.look()

    def _fail(self, *whys: str) -> None:
        self._end(False, "; ".join(filter(None, (*whys, self._arm.trouble, self._reach.trouble))))

    def _on_filter(self) -> None:
        if self._report.state == ExplorerStatus.STATE_WAITING and not (self._arm.trouble or self._reach.trouble):
            self._progressed_at = time.monotonic()
            if self._held:
                self._report.say(ExplorerStatus.STATE_PAUSED, "a person has the finger; ~/resume lets it touch")
            else:
                self._report.say(ExplorerStatus.STATE_EXPLORING, "touching")
                self._begin()
        self._report.stamp = self._filter.stamp
        self._go_on()

    def _on_jump(self) -> None:
        """Stop waiting for stamps from before time ran back."""
        self._moved_until = self._filter.stamp = 0

    # --- one motion after the other

    def _begin(self) -> None:
        """Go down onto the surface, unless that was done already."""
        if not self._begun:
            self._begun = True
            self._carry_out(self._exploration.touch())

    def _carry_out(self, plan: Plan) -> None:
        self._plan = plan
        self._advance(None)

    def _advance(self, done: Done | None) -> None:
        """Start the plan's next act; after the last one the next motion, once the filter has seen the new pose."""
        if self._plan is None or self._report.over:
            return
        try:
            act = self._plan.send(done)
        except StopIteration:
            self._plan, self._moved_until = None, max(self._moved_until, self._sight.stamp)
            self._progressed_at = time.monotonic()
            self._report.tell()
            self._go_on()
        else:
            self._reach.ask(act) if isinstance(act, CheckReach) else self._arm.carry_out(act)

    def _on_reach(self, reached: bool, why_not: str) -> None:
        self._advance(Done(reached, why_not, 0.0, self._exploration.motions.touching, self._sight.gel))

    def _on_done(self, result: Any | None) -> None:
        done = done_of(result, self._sight.base, self._exploration.motions.touching, self._sight.gel)
        self._unjudged = True
        if result is not None:
            self._moved_until = stamp_ns(result.pose.header.stamp)
        if not done.success:
            self._report.problem("unfinished_motions", done.message)
            if self._report.state == ExplorerStatus.STATE_PAUSED:  # the person who asked for it waits for it
                self._report.say(ExplorerStatus.STATE_PAUSED, done.message)
        self._advance(done)

    def _go_on(self) -> None:
        resting = self._plan is None and self._filter.stamp >= self._moved_until
        if self._report.over or not resting or self._change.pending or self._suggestions.pending:
            return
        if self._orders:
            self._carry_out(self._orders.popleft()())
        elif self._report.state == ExplorerStatus.STATE_EXPLORING and self._begun:
            if self._unjudged:
                self._exploration.judge(*self._filter.judged)
                self._unjudged = self._filter.measured = False
            if self._ended():
                return
            begun = self._filter.state != FilterStatus.STATE_UNINITIALISED and self._exploration.motions.touching
            if self._suggestions.ready and begun:
                self._suggestions.ask_where()
            else:
                self._decide(None)

    def _on_advice(self, advice: Advice | None, why_not: str) -> None:
        if self._report.state != ExplorerStatus.STATE_EXPLORING:  # it is over, or a person has the finger by now
            self._go_on()
            return
        if why_not:
            self._report.problem("refused_suggestions", f"suggest_motion: {why_not}")
            self._exploration.refused(why_not)
        self._decide(advice)

    def _decide(self, advice: Advice | None) -> None:
        reason, plan = self._exploration.decide(advice, self._sight.of_filter(), self._filter.state)
        if self._ended():
            return
        self._report.say(self._report.state, reason)
        self._carry_out(plan)

    # --- a person

    def _take(self, order: Order | None, reason: str) -> None:
        if self._report.over or self._report.state == ExplorerStatus.STATE_WAITING:
            raise InputError(f"not while {self._report.state}: {self._report.reason}")
        if order is not None:
            self._begin()
            self._orders.append(order)
        self._report.say(ExplorerStatus.STATE_PAUSED, reason)
        self._go_on()

    def _resume(self) -> None:
        self._held = False  # in case it still waits
        if self._report.state == ExplorerStatus.STATE_PAUSED:
            self._report.say(ExplorerStatus.STATE_EXPLORING, "going on by itself")
            self._begin()
            self._go_on()

    def _on_object_changed(self, mesh_path: str, why_not: str) -> None:
        """Explore the new object; if the change failed, leave the finger to the person who asked for it."""
        if why_not:
            self._report.say(ExplorerStatus.STATE_PAUSED, f"the object was not changed: {why_not}")
            return
        self._show(mesh := load_mesh(mesh_path))
        self._exploration.restart()
        self._report.say(ExplorerStatus.STATE_EXPLORING, f"there is another object: {mesh.name}")
        self._carry_out(self._exploration.touch())

    def _show(self, mesh: ObjectMesh | None) -> None:
        self._sight.shown = mesh
        if mesh is not None:
            self._report.show_object(mesh)

    def _ended(self) -> bool:
        """Return whether there is a verdict on the exploration; if so, report it."""
        if (verdict := self._exploration.verdict) is not None:
            self._end(verdict.known, verdict.words)
        return verdict is not None

    def _end(self, known: bool, words: str) -> None:
        self._report.end(known, words)
        self.gave_up = not known
        self._on_end()


def main(args: list[str] | None = None) -> int:
    """Entry point of the executable; exit code 1: the exploration ended without knowing the pose."""
    return spin.run(lambda: [Explorer(on_end=spin.stop)], args)


if __name__ == "__main__":
    sys.exit(main())
