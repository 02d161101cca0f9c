"""Node `explorer`: a simulated arm whose finger explores an object until the filter knows its pose."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from rclpy.clock import Clock, ClockType

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos, spin
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameters
from midastouch_filter.nodes.object_source import resolve
from midastouch_msgs.msg import ExplorerStatus, FilterStatus, Suggestion
from midastouch_msgs.srv import SetObject, SuggestMotion
from midastouch_perception.sensor_model import SensorModel

from ..explore.exploration import TELLS, Exploration, Motion, Poses, World
from .explorer_control import ExplorerControl, FingerGoals, Order, motion_of
from .explorer_parameters import PARAMETERS
from .explorer_report import ExplorerReport
from .explorer_services import ObjectChange, SuggestionClient
from .finger import FingerMarker, FingerTf

_IN_FLIGHT = 3  # images that are not answered yet; digit_sim leaves some out when more are due at once
AT_REST_S = 1.0  # between images while nothing moves: the last may have been lost, and the filter calls silence stale
_SUGGESTIONS = 24  # asked for: all that are offered


class Explorer(PipelineNode):
    """Moves a simulated finger, one image's time after the other, as fast as the filter follows.

    It asks `suggest_motion` where to touch next, and moves at random while nobody offers that. `on_end` is called once
    the exploration is over; `gave_up` is set if it ended without knowing the pose. A person who calls one of its
    services, or shows it a point, has the finger from then on, until `~/resume`.
    """

    def __init__(self, on_end: Callable[[], None] = lambda: None, **kwargs) -> None:
        super().__init__("explorer", **kwargs)
        settings = self._settings = Parameters(self, PARAMETERS)
        rng = np.random.default_rng(settings["seed"])
        sensor = SensorModel.load(settings["sensor_model"])
        self._world = World(_load(settings["mesh"]), sensor, rng, settings["speed"] / settings["fps"])
        self._exploration = Exploration(self._world, rng, settings["max_path"])

        self._on_end, self.gave_up = on_end, False
        self._heard_at = self._progressed_at = time.monotonic()
        self._filter_state, self._filter_reason, self._measured = "", "", False
        self._untouched = 0
        self._begun = False
        self._poses: Poses | None = None
        self._orders: deque[Order] = deque()

        frames = {name: settings[f"{name}_frame_id"] for name in ("base", "object", "sensor")}
        self._tf = FingerTf(self, self._world, settings["fps"], frames)
        self._report = ExplorerReport(self, self._exploration, frames["base"], frames["object"], lambda: self._tf.stamp)
        self.create_subscription(FilterStatus, "filter_status", self._on_filter, qos.latched(depth=100))
        self._suggestions = SuggestionClient(self, self._on_suggestions, self._refused)
        self._change = ObjectChange(self, self._on_object_changed)
        control = ExplorerControl(self, self._exploration, self._take, self._resume, self._exchange, _load)
        problem = self._report.problem
        goals = FingerGoals(self, self._exploration, frames, self._take, problem)
        FingerMarker(self, self._world, frames["object"], goals.send, control.commands, problem)
        self.create_timer(1 / settings["fps"], self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- the next pose, once the filter has answered

    def _look(self) -> None:
        """Keep images coming while nothing moves, and an answer that does not come from being awaited for ever."""
        now = time.monotonic()
        if self._report.over:
            return
        if (silent := now - self._heard_at) > self._settings["patience"]:
            whose = "of set_object" if self._change.pending else "on filter_status"
            self._end(False, f"no answer {whose} for {silent:.0f} s: do digit_sim and the localisation run?")
            return
        # a filter that lags behind answers, but too late for the finger to go on
        working = self._report.state in (ExplorerStatus.STATE_WAITING, ExplorerStatus.STATE_EXPLORING)
        if not working or self._change.pending or not self._filter_state:
            self._progressed_at = now
        if (stuck := now - self._progressed_at) > self._settings["patience"]:
            filter_says = f"{self._filter_state}: {self._filter_reason}"
            self._end(False, f"the finger could not go on for {stuck:.0f} s; the filter says {filter_says}")
            return
        at_rest = self._report.state == ExplorerStatus.STATE_WAITING or now - self._tf.moved_at > AT_REST_S
        if at_rest and not self._change.pending:
            self._tf.publish()
        self._suggestions.look()

    def _on_filter(self, status: FilterStatus) -> None:
        ours = status.state != FilterStatus.STATE_WAITING and self._tf.answered(stamp_ns(status.header.stamp))
        if not ours or self._report.over:
            return
        self._heard_at = time.monotonic()
        # one that does not know yet which object it is says nothing of contact
        touches = status.state != FilterStatus.STATE_NO_CONTACT
        self._filter_state, self._filter_reason = status.state, status.reason
        self._measured = self._measured or touches
        if self._report.state == ExplorerStatus.STATE_WAITING:
            if touches and status.state != FilterStatus.STATE_UNINITIALISED:
                return
            self._untouched += 1
            self._progressed_at = self._heard_at
            if self._untouched < self._settings["untouched_frames"]:
                return  # `tdn` would take a contact for part of the untouched sensor, and measure it for ever
            if self._settings["start_paused"]:
                self._report.say(ExplorerStatus.STATE_PAUSED, "~/resume lets it touch")
            else:
                self._report.say(ExplorerStatus.STATE_EXPLORING, "touching")
                self._begin()
        self._go_on()

    def _begin(self) -> None:
        """Down onto the surface, if it has not been there."""
        if not self._begun:
            self._begun, self._poses = True, self._exploration.touch()

    def _go_on(self) -> None:
        """The next poses, as far as the filter has followed; after the last one the next motion."""
        if self._change.pending:
            return
        while self._poses is not None and len(self._tf.awaited) < _IN_FLIGHT:
            if next(self._poses, None) is None:
                self._poses = None
                self._report.tell()
            else:
                self._tf.publish()
                self._progressed_at = time.monotonic()
        if self._poses is None and not self._suggestions.pending and not self._tf.awaited:
            self._decide()

    # --- the next motion

    def _decide(self) -> None:
        if self._orders:
            self._poses = self._orders.popleft()()
            self._go_on()
        elif self._report.state == ExplorerStatus.STATE_EXPLORING:
            self._exploration.judge(self._filter_state, self._filter_reason, self._measured)
            self._measured = False
            if self._ended():
                return
            if self._suggestions.ready and self._filter_state != FilterStatus.STATE_UNINITIALISED:
                longest = self._settings["max_motion"]
                self._suggestions.ask(SuggestMotion.Request(max_length=longest, lifts=True, count=_SUGGESTIONS))
            else:
                self._follow([])

    def _on_suggestions(self, response: SuggestMotion.Response) -> None:
        if self._report.over:
            return
        if self._report.state != ExplorerStatus.STATE_EXPLORING:  # a person has the finger by now
            self._go_on()
        elif not response.success:
            self._refused(response.message)
        elif response.indistinguishable and not any(each.information > TELLS for each in response.suggestions):
            self._move(self._exploration.hopeless(response.message), "elsewhere, as nothing within reach would tell")
        else:
            self._exploration.accepted()
            # the best by metre are mere steps; each motion is awaited, so that one that tells much is worth its way
            self._follow(sorted(response.suggestions, key=lambda each: -each.information))

    def _refused(self, why: str) -> None:
        self._report.problem("refused_suggestions", f"suggest_motion: {why}")
        self._exploration.refused(why)
        self._follow([])

    def _follow(self, suggestions: Sequence[Suggestion]) -> None:
        reason = suggestions[0].reason if suggestions else "somewhere, as nothing better is known"
        self._move([motion_of(each) for each in suggestions], reason)

    def _move(self, motions: Sequence[Motion], reason: str) -> None:
        if self._ended():
            return
        self._report.say(self._report.state, reason)
        self._poses = self._exploration.go(motions)
        self._go_on()

    # --- a person

    def _take(self, order: Order | None, reason: str) -> str:
        if self._report.over or self._report.state == ExplorerStatus.STATE_WAITING:
            return f"not while {self._report.state}: {self._report.reason}"
        if order is not None:
            self._begin()
            self._orders.append(order)
        self._report.say(ExplorerStatus.STATE_PAUSED, reason)
        self._go_on()
        return ""

    def _resume(self) -> None:
        if self._report.state == ExplorerStatus.STATE_PAUSED:
            self._report.say(ExplorerStatus.STATE_EXPLORING, "going on by itself")
            self._begin()
            self._go_on()

    def _exchange(self, request: SetObject.Request) -> Poses:
        self._heard_at = time.monotonic()
        self._change.begin(request)
        return iter(())

    def _on_object_changed(self, mesh_path: str, why_not: str) -> None:
        """Explore the new object; or leave the finger to the person who wanted one."""
        if why_not:
            self._report.say(ExplorerStatus.STATE_PAUSED, f"the object was not changed: {why_not}")
            return
        try:
            self._world.put(_load(mesh_path))
        except InputError as error:
            self._end(False, str(error))
            return
        self._report.show_object()
        self._exploration.restart()
        self._poses = self._exploration.touch()
        self._report.say(ExplorerStatus.STATE_EXPLORING, f"there is another object: {self._world.mesh.name}")
        self._go_on()

    def _ended(self) -> bool:
        """Whether the exploration has come to a verdict; it is told then."""
        if (verdict := self._exploration.verdict) is not None:
            self._end(verdict.known, verdict.words)
        return verdict is not None

    def _end(self, known: bool, words: str) -> None:
        self._report.end(known, words)
        self.gave_up = not known
        self._on_end()


def _load(mesh: str) -> ObjectMesh:
    return ObjectMesh.load(resolve(mesh, "mesh"))


def main(args: Sequence[str] | None = None) -> int:
    """Entry point of the executable; exit code 1: the exploration ended without knowing the pose."""
    return spin.run(lambda: [Explorer(on_end=spin.stop)], args)


if __name__ == "__main__":
    sys.exit(main())
