"""Node `particle_filter`: codes and transforms -> where on the object the sensor is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from rclpy.clock import Clock, ClockType

from midastouch_msgs.msg import TactileCode
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos, spin
from midastouch_perception.ros.conversions import stamp_ns
from midastouch_perception.ros.managed_node import ManagedNode

from ..state import STALE, UNINITIALISED, Status
from ..touch import Measurement
from .code_message import measurement_from_msg
from .estimate_publisher import EstimatePublisher
from .filter_parameters import PARAMETERS, config_of, start_of
from .filter_services import FilterServices
from .finger_topics import FingerTopics, fingers_of
from .localiser import LoadedObject, Localiser, load_object
from .object_source import NewObject, ObjectSource
from .relief_source import ReliefSource
from .start_topics import StartTopics
from .status_report import StatusReport
from .transform_queue import TransformQueue
from .transform_source import TransformSource

# Stamps that run back by more than this are a new run (a looped bag); by less, a message out of order.
_JUMP_NS = 500_000_000


class ParticleFilterNode(ManagedNode):
    """While active, every code is answered by one FilterStatus of its stamp, unless time runs back while it waits; one
    before may say that it waits.

    A code is processed once the sensor's transform at its stamp is known. `load` replaces the reading of mesh
    and codebook; with `subscribe` false codes come through `on_code` from a stage in the same process.
    """

    def __init__(
        self,
        load: Callable[..., LoadedObject] = load_object,
        subscribe: bool = True,
        **node_options,
    ):
        super().__init__("particle_filter", PARAMETERS, **node_options)
        self._load, self._subscribe = load, subscribe
        simulated = self.get_parameter("use_sim_time").value
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        # Paused simulated time must not run out the time-outs; live, a clock that NTP cannot step.
        self._patience_clock = self.get_clock() if simulated else self._steady_clock
        self._out = EstimatePublisher(self, self.parameters, self._now)
        FilterServices(self, lambda: self._localiser if self.active else None, self._change_object)
        self.autostart()

    # --- lifecycle

    def say(self, doing: str) -> None:
        """On `filter_status`, too, which whoever comes late hears as well."""
        super().say(doing)
        self._out.status(self._now_ns(), Status(UNINITIALISED, doing))

    def configure(self) -> None:
        """Load mesh and codebook, and prepare the filter's start on them."""
        self._config = config_of(self.parameters)
        base, sensor = self.parameters["base_frame_id"], self.parameters["sensor_frame_id"]
        self._frames = base, sensor, *fingers_of(self.parameters).values()
        self._objects = ObjectSource(self._load, self.parameters, self._config)
        self._localiser = Localiser(start_of(self.parameters), self.parameters["init_mode"] == "wait")
        self._untouched = True
        mesh, codebook = self.parameters["mesh"], self.parameters["codebook"]
        if mesh or codebook:
            self.say(_loading(mesh, codebook))
        first = self._objects.initial()
        if first is not None:
            self._take(first)

    def unload(self) -> None:
        """Forget the object and the filter."""
        self._localiser = self._objects = None

    def connect(self) -> None:
        """Listen to codes and transforms, from the beginning."""
        self._newest: int | None = None
        self._network_id = ""
        self._last_arrival: float | None = None
        self._silent = False
        if not self._untouched:  # what was felt counts no more: the object may have been moved meanwhile
            self._untouched = True
            self._localiser.restart()
        base, sensor, *_ = self._frames
        self._transforms = TransformSource(
            self,
            frames=self._frames,
            on_update=self._process_queue,
            on_jump=self._on_transforms_jump,
            on_bad=lambda reason: self.diagnostics.problem("bad_transforms", reason),
        )
        self._reliefs: ReliefSource | None = None
        self._queue = TransformQueue(
            lambda stamp: self._transforms.lookup(base, sensor, stamp),
            self._is_incomplete,
            self._now,
            lambda: self.parameters["transform_timeout"],
            lambda: 1e-9 * self._steady_clock.now().nanoseconds,
        )
        said = self._now, self._process_queue, self.diagnostics.problem
        self._fingers = FingerTopics(self, self.parameters, self._config.refinement, self._transforms, *said)
        self._report = StatusReport(self._out, self._fingers, self._transforms.name)
        StartTopics(self, self.parameters, self._localiser, self._transforms, self.diagnostics.problem)
        self.create_timer(0.05, self._on_timer, clock=self._steady_clock)
        if self._subscribe:
            profile = qos.stage_subscriber(self.parameters["queue_depth"], self.parameters["reliable"])
            if self._config.refinement:
                self._reliefs = self._make_relief_source()
            self.create_subscription(TactileCode, "tactile/code", self._on_code_msg, profile)
        self._report.say(self._now_ns(), UNINITIALISED, self._waits_for())

    def disconnect(self) -> None:
        """Stop reading transforms."""
        self._transforms.close()

    def describe(self) -> tuple[bytes, str, dict]:
        """Level, message and values for the diagnostics."""
        return self._report.describe()

    def _make_relief_source(self) -> ReliefSource:
        return ReliefSource(
            self,
            self.parameters["queue_depth"],
            self.parameters["reliable"],
            on_cloud=self._process_queue,
            on_bad=lambda reason: self.diagnostics.problem("bad_clouds", reason),
        )

    def _now(self) -> float:
        return 1e-9 * self._patience_clock.now().nanoseconds

    def _now_ns(self) -> int:
        """Stamp of what is said of no image."""
        # a replay's clock stands at the stamp of the image that it waits for, whose answer this is not
        return max(0, self.get_clock().now().nanoseconds - 1)

    # --- codes

    def _on_code_msg(self, msg: TactileCode) -> None:
        self.on_code(stamp_ns(msg.header.stamp), measurement_from_msg(msg))

    def on_code(self, stamp: int, measurement: Measurement) -> None:
        """Take one code, stamp in ns; it is answered when its transform is there.

        What comes while the node is not active is dropped.
        """
        if not self.active:
            return
        if self._newest is not None and stamp < self._newest - _JUMP_NS:
            self._transforms.rewind(stamp)
            self._reset(stamp)
        elif self._newest is not None and stamp <= self._newest:
            self._report.counts["out_of_order"] += 1
            self._report.say(stamp, STALE, "out of order: this code or a later one was here before")
            return
        self._newest, self._network_id = stamp, measurement.network_id
        self._last_arrival, self._silent = self._now(), False
        self._queue.push(stamp, measurement)
        self._process_queue()

    def _is_incomplete(self, stamp: int, measurement: Measurement, waited: float) -> bool:
        """Whether the code's cloud or what another finger felt is still to come."""
        if self._reliefs is not None and measurement.in_contact and self._reliefs.awaited(stamp, waited):
            return True
        return self._fingers.awaited(stamp, waited)

    def _process_queue(self) -> None:
        while (ready := self._queue.pop()) is not None:
            if ready.transform is None:
                self._report.counts["transform_timeout"] += 1
                self._report.say(ready.stamp, STALE, f"no transform {' -> '.join(self._frames[:2])}: {ready.reason}")
            else:
                self._process(ready.stamp, ready.transform, ready.payload)
        if (waiting := self._queue.untold()) is not None:
            self._report.wait(waiting.stamp, waiting.reason)

    def _process(self, stamp: int, T_base_gel: np.ndarray, measurement: Measurement) -> None:
        self._untouched = False
        sensor = self._localiser.object.sensor if self._localiser.object is not None else None
        if self._reliefs is not None and sensor is not None and measurement.in_contact:
            measurement = dataclasses.replace(measurement, penetration=self._reliefs.take(stamp, sensor))
            self._report.counts["no_relief"] += measurement.penetration is None
        try:
            others = self._fingers.take(stamp, T_base_gel, self._localiser.object)
            estimate = self._localiser.process(T_base_gel, measurement, others)
        except InputError as error:
            self.diagnostics.problem("bad_codes", f"tactile/code: {error}")
            self._report.say(stamp, STALE, f"code refused: {error}")
            return
        if estimate is None:
            self._report.say(stamp, UNINITIALISED, self._localiser.waiting_for)
            return
        self._report.estimate(stamp, estimate, self._localiser.filter, self._localiser.T_base_obj())

    def _waits_for(self) -> str:
        return self._localiser.waiting_for or "waiting for tactile/code"

    def _on_transforms_jump(self, stamp: int) -> None:
        # heard of later than it happened: codes from after the jump may be here already
        if self._newest is not None and self._newest > stamp + _JUMP_NS:
            self._reset(stamp)

    def _reset(self, stamp: int) -> None:
        """Time ran back to `stamp` [ns]. TF and codes may both tell of the same jump, so it counts once."""
        self._queue.clear()
        self._fingers.rewind(stamp)
        self._newest = None
        if self._untouched:
            return
        self._untouched = True
        self._report.counts["time_jumps"] += 1
        self.get_logger().warning("time ran backwards (a looped bag?): starting again")
        self._localiser.restart()

    def _on_timer(self) -> None:
        self._process_queue()
        timeout = self.parameters["input_timeout"]
        if self._last_arrival is None or self._silent or self._queue:
            return
        if (silence := self._now() - self._last_arrival) > timeout:
            self._silent = True
            reason = f"no tactile/code for {silence:.1f} s: is the sensor running? see /diagnostics"
            self._report.say(self._now_ns(), STALE, reason)

    # --- objects

    def _change_object(self, mesh: str, codebook: str) -> None:
        self._report.wait(self._now_ns(), _loading(mesh, codebook))
        try:
            with self.busy(_loading(mesh, codebook)):
                new = self._objects.requested(mesh, codebook, self._network_id)
        except Exception:
            self._report.say_again(self._now_ns())
            raise
        finally:
            # Nobody was silent meanwhile: this node did not listen.
            if self._last_arrival is not None:
                self._last_arrival = self._now()
        self._fingers.clear()
        self._take(new)
        # What waits for its transform was felt on the object before.
        for stamp in self._queue.clear():
            self._report.say(stamp, STALE, "the object was changed while this code waited for its transform")
        self._report.forget()
        self._report.say(self._now_ns(), UNINITIALISED, f"the object is now '{new.loaded.name}': {self._waits_for()}")

    def _take(self, new: NewObject) -> None:
        self._localiser.set_object(new.loaded)
        self._out.show_object(new.address)


def _loading(mesh: str, codebook: str) -> str:
    return f"loading the mesh {mesh} and the codebook {codebook}"


def main(args=None) -> int:
    """Entry point of the executable `particle_filter`."""
    return spin.run(lambda: [ParticleFilterNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())
