"""Node `particle_filter`: codes and transforms -> where on the object the sensor is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from rclpy.clock import Clock, ClockType
from std_srvs.srv import Empty

from midastouch_msgs.msg import TactileCode
from midastouch_msgs.srv import SetObject
from midastouch_perception.errors import InputError
from midastouch_perception.ros import diagnostics, qos, spin
from midastouch_perception.ros.conversions import stamp_ns
from midastouch_perception.ros.node import PipelineNode
from midastouch_perception.ros.parameters import Parameters

from ..filter import Measurement
from ..state import STALE, UNINITIALISED, Status
from .estimate_publisher import EstimatePublisher
from .filter_parameters import PARAMETERS, config_of, start_of
from .finger_topics import FingerTopics, fingers_of
from .localiser import LoadedObject, Localiser, load_object
from .object_source import NewObject, ObjectSource
from .relief_source import ReliefSource
from .start_topics import StartTopics
from .transform_queue import TransformQueue
from .transform_source import TransformSource

# Stamps that run back by more than this are a new run (a looped bag); by less, a message out of order.
_JUMP_NS = 500_000_000


class ParticleFilterNode(PipelineNode):
    """Every code is answered by one FilterStatus of its stamp, unless time runs back while it waits.

    A code is processed once the sensor's transform at its stamp is known. `load` replaces the reading of mesh
    and codebook; with `subscribe` false codes come through `on_code` from a stage in the same process.
    """

    def __init__(
        self,
        load: Callable[..., LoadedObject] = load_object,
        subscribe: bool = True,
        **node_options,
    ):
        super().__init__("particle_filter", **node_options)
        self.parameters = Parameters(self, PARAMETERS)
        self._config = config_of(self.parameters)
        self._objects = ObjectSource(load, self.parameters, self._config)
        # Before any topic is announced: who waits for this node's topics finds it ready.
        first = self._objects.initial()
        simulated = self.get_parameter("use_sim_time").value
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        # Paused simulated time must not run out the time-outs; live, a clock that NTP cannot step.
        self._patience_clock = self.get_clock() if simulated else self._steady_clock
        self._newest: int | None = None
        self._network_id = ""
        self._last_arrival: float | None = None
        self._silent = False
        self._untouched = True
        self._counts = {"transform_timeout": 0, "out_of_order": 0, "time_jumps": 0, "no_relief": 0}
        self._status = Status(UNINITIALISED, "waiting for tactile/code")

        self._out = EstimatePublisher(self, self.parameters, self._now)
        self.diagnostics = diagnostics.Diagnostics(self, self._describe)
        self._localiser = Localiser(start_of(self.parameters), self.parameters["init_mode"] == "wait")
        base, sensor = self.parameters["base_frame_id"], self.parameters["sensor_frame_id"]
        self._transforms = TransformSource(
            self,
            frames=(base, sensor, *fingers_of(self.parameters).values()),
            on_update=self._process_queue,
            on_jump=self._reset,
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
        if first is not None:
            self._set_object(first)
        self._connect(subscribe)
        self._say(self._now_ns(), UNINITIALISED, self._localiser.waiting_for or "waiting for tactile/code")

    def _connect(self, subscribe: bool) -> None:
        if subscribe:
            profile = qos.stream_subscriber(self.parameters["queue_depth"], self.parameters["reliable"])
            if self._config.refinement:
                self._reliefs = self._make_relief_source()
            self.create_subscription(TactileCode, "tactile/code", self._on_code_msg, profile)
        StartTopics(self, self.parameters, self._localiser, self._transforms, self.diagnostics.problem)
        self.create_service(Empty, "reinitialize_global_localization", self._on_reinitialize)
        self.create_service(Empty, "request_nomotion_update", self._on_nomotion_update)
        self.create_service(SetObject, "set_object", self._on_set_object)
        self.create_timer(0.05, self._on_timer, clock=self._steady_clock)

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
        return self.get_clock().now().nanoseconds

    # --- codes

    def _on_code_msg(self, msg: TactileCode) -> None:
        code = np.frombuffer(msg.code, np.float32) if msg.in_contact else None
        measurement = Measurement(msg.in_contact, code, msg.contact_area, msg.network_id)
        self.on_code(stamp_ns(msg.header.stamp), measurement)

    def on_code(self, stamp: int, measurement: Measurement) -> None:
        """Take one code, stamp in ns; it is answered when its transform is there."""
        if self._newest is not None and stamp < self._newest - _JUMP_NS:
            self._transforms.rewind(stamp)
            self._reset()
        elif self._newest is not None and stamp <= self._newest:
            self._counts["out_of_order"] += 1
            self._out.status(stamp, self._with_counts(self._status))
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
                self._counts["transform_timeout"] += 1
                frames = f"{self.parameters['base_frame_id']} -> {self.parameters['sensor_frame_id']}"
                self._say(ready.stamp, STALE, f"no transform {frames}: {ready.reason}")
            else:
                self._process(ready.stamp, ready.transform, ready.payload)

    def _process(self, stamp: int, T_base_gel: np.ndarray, measurement: Measurement) -> None:
        self._untouched = False
        sensor = self._localiser.object.sensor if self._localiser.object is not None else None
        if self._reliefs is not None and sensor is not None and measurement.in_contact:
            measurement = dataclasses.replace(measurement, relief=self._reliefs.take(stamp, sensor))
            self._counts["no_relief"] += measurement.relief is None
        try:
            others = self._fingers.take(stamp, T_base_gel, self._localiser.object)
            estimate = self._localiser.process(T_base_gel, measurement, others)
        except InputError as error:
            self.diagnostics.problem("bad_codes", f"tactile/code: {error}")
            self._say(stamp, STALE, f"code refused: {error}")
            return
        if estimate is None:
            self._say(stamp, UNINITIALISED, self._localiser.waiting_for)
            return
        estimate = dataclasses.replace(estimate, status=self._with_counts(estimate.status))
        self._status = estimate.status
        self._out.estimate(stamp, estimate, self._localiser.filter, self._localiser.T_base_obj())

    def _with_counts(self, status: Status) -> Status:
        skipped = {**status.skipped, **self._counts, **self._out.skipped, **self._fingers.counts}
        return dataclasses.replace(status, skipped=skipped, reason=self._fingers.qualify(status.reason))

    def _say(self, stamp: int, state: str, reason: str) -> None:
        """Publish a state that no step of the filter made; its other numbers are those of the last step."""
        self._status = self._with_counts(dataclasses.replace(self._status, state=state, reason=reason, ms={}))
        self._out.status(stamp, self._status)

    def _reset(self) -> None:
        """Time ran backwards. TF and codes may both tell of the same jump, so it counts once."""
        self._queue.clear()
        self._fingers.clear()
        self._newest = None
        if self._untouched:
            return
        self._untouched = True
        self._counts["time_jumps"] += 1
        self.get_logger().warning("time ran backwards (a looped bag?): starting again")
        self._localiser.restart()

    def _on_timer(self) -> None:
        self._process_queue()
        timeout = self.parameters["input_timeout"]
        if self._last_arrival is None or self._silent or self._queue:
            return
        if (silence := self._now() - self._last_arrival) > timeout:
            self._silent = True
            self._say(
                self._now_ns(), STALE, f"no tactile/code for {silence:.1f} s: is the sensor running? see /diagnostics"
            )

    # --- services

    def _on_reinitialize(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        self._localiser.start_anywhere()
        return response

    def _on_nomotion_update(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        if self._localiser.filter is not None:
            self._localiser.filter.force_update()
        return response

    def _on_set_object(self, request: SetObject.Request, response: SetObject.Response) -> SetObject.Response:
        try:
            new = self._objects.requested(request.mesh_path, request.codebook_path, self._network_id)
        except InputError as error:
            response.message = str(error)
            return response
        # What waits for its transform was felt on the object before.
        for stamp in self._queue.clear():
            self._say(stamp, STALE, "the object was changed while this code waited for its transform")
        self._set_object(new)
        waits_for = self._localiser.waiting_for or "waiting for tactile/code"
        self._status = Status(UNINITIALISED, "")
        self._say(self._now_ns(), UNINITIALISED, f"the object is now '{new.loaded.name}': {waits_for}")
        response.success = True
        return response

    def _set_object(self, new: NewObject) -> None:
        self._fingers.clear()
        self._localiser.set_object(new.loaded)
        self._out.show_object(new.address)

    def _describe(self) -> tuple[bytes, str, dict]:
        s = self._status
        level = diagnostics.WARN if s.state in ("stale", "lost", "uninitialised") else diagnostics.OK
        values = {"state": s.state, "n_particles": s.n_particles, "ess": f"{s.ess:.0f}", **s.skipped}
        values |= {f"{name}_ms": f"{ms:.2f}" for name, ms in s.ms.items()}
        return level, f"{s.state}: {s.reason}", values


def main(args=None) -> int:
    """Entry point of the executable `particle_filter`."""
    return spin.run(lambda: [ParticleFilterNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())
