"""Node `particle_filter`: from codes and transforms to the sensor's pose on the object."""

from __future__ import annotations

from collections.abc import Callable

from midastouch_common.ros import diagnostics, spin
from midastouch_common.ros.graph_watch import OnlyPublisher, publishers
from midastouch_common.ros.managed_node import ManagedNode

from ..core.presets import PAPER
from ..core.state import UNINITIALISED, Status
from ..core.touch import Measurement
from ..identification.catalogue import Catalogue
from ..identification.catalogue_localiser import CatalogueLocaliser
from ..loaded_object import SIZE, LoadedObject, build_object, load_object
from ..localiser import Localiser
from .code_processor import CodeProcessor
from .estimate_publisher import EstimatePublisher
from .filter_parameters import GONE, PARAMETERS, config_of, start_of
from .filter_services import FilterServices, StartTopics
from .finger_topics import fingers_of
from .motion_advice import MotionAdvice
from .node_clock import NodeClock
from .object_source import NewObject, ObjectSource


class ParticleFilterNode(ManagedNode):
    """Node that, while active, answers every code by one FilterStatus of its stamp, unless time runs back while the
    code waits. A status `waiting` may precede the answer.

    A code is processed once the sensor's transform at its stamp is known. `load` replaces the reading of mesh and
    codebook, `build` that of a mesh whose codebook is built. With `subscribe` false, codes come through `on_code` from
    a stage in the same process.
    """

    _advice: MotionAdvice | None = None  # `destroy_node` may be called before it is set

    def __init__(
        self,
        load: Callable[..., LoadedObject] = load_object,
        build: Callable[..., LoadedObject] = build_object,
        subscribe: bool = True,
        **node_options,
    ):
        self._localiser: Localiser | None = None  # set first: `super` destroys a node that it refuses
        super().__init__("particle_filter", PARAMETERS, GONE, **node_options)
        self._load, self._build, self._subscribe = load, build, subscribe
        self._codes: CodeProcessor | None = None  # of the active node
        self._time, self._codes_from = NodeClock(self), OnlyPublisher(self, "tactile/code")
        self._out = EstimatePublisher(self, self.parameters, self._time.now)
        FilterServices(self, self._active_localiser, self._change_object)
        self._advice = MotionAdvice(
            self, self._active_localiser, self.parameters, self._time.steady_now, self._time.stamp
        )
        self.autostart()

    def say(self, doing: str) -> None:
        """Announce what the node does, on `filter_status`, too, which late subscribers also receive."""
        super().say(doing)
        self._out.status(self._time.stamp(), Status(UNINITIALISED, doing))

    def configure(self) -> None:
        """Load mesh and codebook, and prepare the filter's start on them."""
        self._config = config_of(self.parameters)
        fingers_of(self.parameters)  # raises now if they cannot be used
        self._objects = ObjectSource(self._load, self._build, self.parameters, self._config)
        self._localiser = Localiser(start_of(self.parameters), self.parameters["init_mode"] == "wait")
        if objects := self.parameters["objects"]:
            self.say(f"loading the objects {objects}")
            self._localiser = self._on_catalogue(self._objects.catalogue())
        mesh, codebook = self.parameters["mesh"], self.parameters["codebook"]
        if mesh or codebook:
            self.say(_loading(mesh, codebook))
            if not codebook:  # which takes many seconds
                self.get_logger().info(_loading(mesh, codebook))
        elif not objects:
            self.get_logger().warning(
                "no object, so no pose: start again with object:=NAME of a bundled one, mesh:=FILE or objects:=..., or "
                "call the service set_object"
            )
        first = self._objects.initial()
        if first is not None:
            self._take(first)

    def _on_catalogue(self, catalogue: Catalogue) -> CatalogueLocaliser:
        for name, original in catalogue.duplicates.items():
            self.get_logger().warning(f"objects: {name} is the same mesh as {original}; both are called {original}")
        return CatalogueLocaliser(
            catalogue,
            self._config,
            self.parameters["seed"],
            on_object=lambda entry: self._out.show_object(entry.mesh.path),
            on_identity=self._out.identity,
        )

    def unload(self) -> None:
        """Forget the object and the filter."""
        self._end_growth()
        self._localiser = self._objects = None

    def destroy_node(self) -> None:
        """Stop building a codebook, close the action, which rclpy would leave alone, and destroy the node."""
        self._end_growth()
        if self._advice is not None:
            self._advice.close()
            self._advice = None
        super().destroy_node()

    def _end_growth(self) -> None:
        if self._localiser is not None:
            self._localiser.close()

    def connect(self) -> None:
        """Start to listen to codes and transforms."""
        if not self._localiser.untouched:  # earlier measurements no longer count: the object may have been moved
            self._localiser.restart()
        maps = self._config.refinement and self.parameters["preset"] != PAPER
        self._codes = CodeProcessor(
            self, self._localiser, self._out, self._time, maps, self._subscribe, self._advice.changed
        )
        StartTopics(self, self.parameters, self._localiser, self._codes.transforms, self.diagnostics.problem)
        self._codes.report.say(self._time.stamp(), UNINITIALISED, self._codes.waits_for)

    def disconnect(self) -> None:
        """Stop reading transforms, and stop advising."""
        if self._advice is not None:
            self._advice.stop("the node was deactivated")
        if self._codes is not None:
            self._codes.close()
            self._codes = None

    def obstacles(self) -> dict[str, str]:
        """Return why there is no pose although the node is active: codes or transforms do not come at all."""
        obstacles = self._codes.obstacles()
        if self._subscribe and not self._codes.network_id and not publishers(self, "tactile/code"):
            topic = self.resolve_topic_name("tactile/code")
            obstacles["no_codes"] = (
                f"no code on {topic}, so no pose: no node publishes it; start midastouch run perception"
            )
        return obstacles

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        level, message, values = self._codes.report.describe()
        if self._subscribe and (problem := self._codes_from.problem):
            level, message = max(level, diagnostics.WARN), problem
        if (loaded := self._localiser.object) is not None:
            values["codebook"] = loaded.density
        if isinstance(self._localiser, CatalogueLocaliser) and (identity := self._localiser.identity) is not None:
            values["objects"] = identity.in_words()
        return level, message, values

    def on_code(self, stamp: int, measurement: Measurement) -> None:
        """Take one code, stamp in ns; while the node is not active, codes are dropped."""
        if self.active:
            self._codes.on_code(stamp, measurement)

    def _active_localiser(self) -> Localiser | None:
        return self._localiser if self.active else None

    def _change_object(self, mesh: str, codebook: str) -> None:
        stamp, report = self._time.stamp, self._codes.report
        report.wait(stamp(), _loading(mesh, codebook))
        try:
            with self.busy(_loading(mesh, codebook)):
                new = self._objects.requested(mesh, codebook, self._codes.network_id)
        except Exception:
            report.say_again(stamp())
            raise
        finally:
            self._codes.forgive_silence()
        self._take(new)
        self._codes.change_object()
        known = f"'{new.loaded.name}'" if codebook else f"'{new.loaded.name}', by a coarse {new.loaded.density}"
        report.say(stamp(), UNINITIALISED, f"the object is now {known}: {self._codes.waits_for}")

    def _take(self, new: NewObject) -> None:
        self._localiser.set_object(new.loaded)
        self._out.show_object(new.address)


def _loading(mesh: str, codebook: str) -> str:
    if codebook:
        return f"loading the mesh {mesh} and the codebook {codebook}"
    return f"loading the mesh {mesh} and building a codebook of {SIZE:,} poses"


def main(args=None) -> int:
    """Entry point of the executable `particle_filter`."""
    return spin.run(lambda: [ParticleFilterNode()], args)


if __name__ == "__main__":
    raise SystemExit(main())
