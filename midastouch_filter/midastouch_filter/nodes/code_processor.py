"""Processing of codes by the active filter node: each waits for its transform, is processed once and answered."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.graph_watch import why_silent
from midastouch_common.ros.managed_node import ManagedNode
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.queue import TransformQueue, Wait
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import TactileCode

from ..core.pace import InTime, always, until_next_frame
from ..core.state import STALE, UNINITIALISED
from ..core.touch import Measurement, measurement_from_msg
from ..localiser import Localiser, seconds_between
from ..timeline import Judgement, Timeline
from .estimate_publisher import EstimatePublisher, Placed
from .finger_topics import FingerTopics, MapSource, fingers_of
from .node_clock import NodeClock
from .status_report import StatusReport


class CodeProcessor:
    """Listener to codes and transforms, from its construction until `close`; the node destroys its subscriptions.

    maps: whether the filter uses them. Without `subscribe` codes come through `on_code` only. on_estimate: called with
    the stamp [ns] of each answered frame. Attributes: transforms; network_id of the newest code; report, of each frame.
    """

    def __init__(
        self,
        node: ManagedNode,
        localiser: Localiser,
        out: EstimatePublisher,
        clock: NodeClock,
        maps: bool,
        subscribe: bool,
        on_estimate: Callable[[int], None],
    ):
        self._node, self._localiser, self._clock, self._on_estimate = node, localiser, clock, on_estimate
        self._parameters, self._problem = node.parameters, node.diagnostics.problem
        self.network_id = ""
        self._timeline = Timeline(self._newest_transform, clock.now)
        self._last_arrival: float | None = None
        self._last_stamp: int | None = None
        self._silent = self._has_had_transforms = False
        self._jumps = 0
        frames = [self._parameters[f"{name}_frame_id"] for name in ("base", "sensor", "gripper")]
        self._base, self._sensor, self._gripper = frames
        self._queue = TransformQueue(
            lambda stamp: self._lookup(self._base, self._sensor, stamp),
            self._is_incomplete,
            clock.now,
            lambda: self._parameters["transform_timeout"],
            clock.steady_now,
        )
        self._fingers = FingerTopics(
            node, self._parameters, maps, self._lookup, clock.now, self._process_queue, self._problem
        )
        self._maps: MapSource | None = None
        if subscribe:
            self._subscribe(maps)
        node.create_timer(0.05, self._on_timer, clock=clock.steady)
        # last: its thread would outlive a constructor that fails after it
        self.transforms = TransformSource(
            node,
            frames=[*filter(None, frames), *fingers_of(self._parameters).values()],
            on_update=self._process_queue,
            on_jump=self._on_transforms_jump,
            on_bad=lambda reason: self._problem("bad_transforms", reason),
        )
        self.report = StatusReport(out, self._fingers, localiser)

    def _subscribe(self, maps: bool) -> None:
        depth, reliable = self._parameters["queue_depth"], self._parameters["reliable"]
        if maps:
            self._maps = MapSource(
                self._node,
                depth,
                reliable,
                on_cloud=self._process_queue,
                on_bad=lambda reason: self._problem("bad_clouds", reason),
            )

        def on_code(msg: TactileCode) -> None:
            self.on_code(stamp_ns(msg.header.stamp), measurement_from_msg(msg))

        self._node.create_subscription(TactileCode, "tactile/code", on_code, qos.stage_subscriber(depth, reliable))

    def _lookup(self, target: str, source: str, stamp: int) -> np.ndarray | Wait:
        return self.transforms.lookup(target, source, stamp)

    def close(self) -> None:
        """Stop reading transforms."""
        self.transforms.close()

    @property
    def waits_for(self) -> str:
        """Phrase on what the next answer waits for."""
        return self._localiser.waiting_for or "waiting for tactile/code"

    def on_code(self, stamp: int, measurement: Measurement) -> None:
        """Take one code, stamp in ns; it is answered once its transform is known."""
        judged = self._timeline.judge(stamp, measurement)
        self._obey(judged)
        if judged.held:
            self.report.wait(stamp, "stamped before the last code; if the next code is, too, time ran back")
        elif judged.late:
            self.report.counts["out_of_order"] += 1
            self.report.say(stamp, STALE, "out of order: this code or a later one was here before")

    def _obey(self, judged: Judgement) -> None:
        for stamp in judged.odd:
            self._refuse(stamp)
        if judged.ran_back:
            self._reset(judged.taken[0][0])
        for stamp, measurement in judged.taken:
            self.network_id = measurement.network_id
            self._last_arrival, self._silent = self._clock.now(), False
            self._queue.push(stamp, measurement)
        self._process_queue()

    def _refuse(self, stamp: int) -> None:
        """Drop a code whose stamp is wrong."""
        self._queue.remove(stamp)
        self.report.counts["odd_stamps"] += 1
        reason = f"stamped {1e-9 * stamp:.3f} s, unlike the codes before and after: dropped"
        self._problem("odd_stamps", f"tactile/code: {reason}; is the sensor's clock right, has it one publisher only?")
        self.report.say(stamp, STALE, reason)

    def obstacles(self) -> dict[str, str]:
        """Return, by kind, why no code can be answered: TF has never led from the base to the sensor."""
        if self._has_had_transforms or self._clock.stamp() == 0:  # simulated time that has not begun
            return {}
        try:
            self.transforms.latest_stamp(self._base, self._sensor)
        except TransformError as error:
            reason = str(error)
        else:
            reason = self._queue.lacks
        return {"no_transform": f"no TF from {self._base} to {self._sensor}, so no pose: {reason}"} if reason else {}

    def _newest_transform(self) -> int | None:
        try:
            return self.transforms.latest_stamp(self._base, self._sensor)
        except TransformError:
            return None

    def forgive_silence(self) -> None:
        """Restart the time-out of input, because the node did not listen until now."""
        if self._last_arrival is not None:
            self._last_arrival = self._clock.now()

    def change_object(self) -> None:
        """Forget what was measured on the old object, and answer the codes that still wait."""
        self._fingers.clear()
        for stamp in self._queue.clear():
            self.report.say(stamp, STALE, "the object was changed while this code waited for its transform")
        self.report.forget()

    def _is_incomplete(self, stamp: int, measurement: Measurement, waited: float) -> bool:
        """Return whether the code's cloud or another finger's measurement is still to come."""
        if self._maps is not None and measurement.in_contact and self._maps.awaited(stamp, waited):
            return True
        return self._fingers.awaited(stamp, waited)

    def _process_queue(self) -> None:
        while (ready := self._queue.pop()) is not None:
            if ready.transform is None:
                self.report.counts["transform_timeout"] += 1
                self.report.say(ready.stamp, STALE, f"no transform {self._base} -> {self._sensor}: {ready.reason}")
            else:
                self._has_had_transforms = True
                self._process(ready.stamp, ready.transform, ready.payload)
        if (waiting := self._queue.unreported()) is not None:
            self.report.wait(waiting.stamp, waiting.reason)

    def _process(self, stamp: int, T_base_gel: np.ndarray, measurement: Measurement) -> None:
        in_time = self._until_next(stamp)
        sensor = self._localiser.sensor
        if self._maps is not None and sensor is not None and measurement.in_contact:
            measurement = dataclasses.replace(measurement, penetration=self._maps.take(stamp, sensor))
            self.report.counts["no_map"] += measurement.penetration is None
        T_gripper_gel = self.transforms.known(self._gripper, self._sensor, stamp) if self._gripper else None
        if self._gripper and T_gripper_gel is None:
            self.report.counts["transform_timeout"] += 1
            reason = f"no transform {self._gripper} -> {self._sensor}: is gripper_frame_id right?"
            self._problem("no_gripper", reason)
            self.report.say(stamp, STALE, reason)
            return
        try:
            others = self._fingers.take(stamp, T_base_gel, self._localiser.object)
            estimate = self._localiser.process(T_base_gel, measurement, others, stamp, T_gripper_gel)
        except InputError as error:
            self._problem("bad_codes", f"tactile/code: {error}")
            self.report.say(stamp, STALE, f"code refused: {error}")
            return
        if estimate is None:
            self.report.say(stamp, UNINITIALISED, self._localiser.waiting_for)
            return
        jumps, self._jumps = self._jumps, estimate.status.skipped.get("odometry_jump", 0)
        if self._jumps > jumps:  # it starts again at each
            self._problem("jumps", f"{self._base} -> {self._sensor}: {estimate.status.reason}")
        placed = Placed(T_base_gel if T_gripper_gel is None else T_gripper_gel, self._localiser.held)
        self.report.estimate(stamp, estimate, self._localiser.filter, placed)
        self._on_estimate(stamp)
        self._localiser.deferred_update(in_time)

    def _until_next(self, stamp: int) -> InTime:
        """Return the limit of a frame that begins now: a live one must hurry, a replay is the same on any machine."""
        elapsed, self._last_stamp = seconds_between(self._last_stamp, stamp), stamp
        live = self._parameters["queue_depth"] == 1  # codes that come meanwhile are dropped
        return until_next_frame(elapsed, self._clock.steady_now) if live else always

    def _on_transforms_jump(self, stamp: int) -> None:
        self._obey(self._timeline.ask_again())

    def _reset(self, stamp: int) -> None:
        """Start again, because time ran back to `stamp` [ns]."""
        self.transforms.rewind(stamp)
        self._queue.clear()
        self._fingers.rewind(stamp)
        if self._localiser.untouched:
            return
        self.report.counts["time_jumps"] += 1
        self._node.get_logger().warning("time ran backwards (a looped bag?): starting again")
        self._localiser.restart()

    def _on_timer(self) -> None:
        self._obey(self._timeline.ask_again())
        self._obey(self._timeline.give_up(self._parameters["transform_timeout"]))
        timeout = self._parameters["input_timeout"]
        if self._last_arrival is None or self._silent or self._queue:
            return
        if (silence := self._clock.now() - self._last_arrival) > timeout:
            self._silent = True
            reason = f"no tactile/code for {silence:.1f} s: {why_silent(self._node, 'tactile/code')}; see /diagnostics"
            self.report.say(self._clock.stamp(), STALE, reason)
