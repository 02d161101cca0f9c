"""Sight of an explorer: the gel's pose, and its surroundings as known to the filter and to a person."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from rclpy.node import Node
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import pose_from_msg, poses_from_msgs, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import PoseModes

from ..exploration.surroundings import Surroundings


class Sight:
    """Sight. Attributes: base: name of the base frame; shown: the mesh that a person sees, None if there is none.

    Args: frames: names of `base`, `object` (of the mesh shown) and `sensor`; on_jump: called after time ran back;
    problem(kind, words): called for invalid messages of other nodes.
    """

    def __init__(
        self, node: Node, frames: Mapping[str, str], on_jump: Callable[[], None], problem: Callable[[str, str], None]
    ):
        self.base, self._object, self._sensor = (frames[name] for name in ("base", "object", "sensor"))
        self._problem = problem
        self.shown: ObjectMesh | None = None
        self._mesh: ObjectMesh | None = None
        self._modes = PoseModes()
        self._gel = np.eye(4)
        node.create_subscription(MarkerArray, "object_mesh", self._on_mesh, qos.latched())
        node.create_subscription(PoseModes, "pose_modes", self._on_modes, qos.stream_subscriber(10, reliable=True))
        # last: it starts a thread, which nothing would end if a later step failed
        self._transforms = TransformSource(
            node,
            frames=(self.base, self._sensor),
            on_jump=lambda stamp: on_jump(),
            on_bad=lambda reason: problem("bad_transforms", reason),
        )

    def close(self) -> None:
        """Stop reading transforms."""
        self._transforms.close()

    @property
    def stamp(self) -> int:
        """Stamp [ns] of the gel's newest pose; 0 before the first."""
        try:
            return self._transforms.latest_stamp(self.base, self._sensor) or 0
        except TransformError:
            return 0

    @property
    def gel(self) -> np.ndarray:
        """The gel's newest pose T_base_gel (4, 4)."""
        pose = self._gel_at(self.stamp)
        self._gel = self._gel if pose is None else pose
        return self._gel

    def of_filter(self) -> Surroundings:
        """Return the surroundings by the filter's most probable pose hypothesis, if it has one."""
        gel = self._gel_at(stamp_ns(self._modes.header.stamp)) if self._mesh and self._modes.modes else None
        if gel is None:
            return Surroundings(self.gel)
        on_object = pose_from_msg(self._modes.modes[0].pose.pose)
        return Surroundings(self.gel, gel @ se3.inverse(on_object), self._mesh)

    def of_person(self) -> Surroundings:
        """Return the surroundings by the mesh that a person sees, if there is one and its frame is on TF."""
        pose = self._frame(self._object) if self.shown else None
        return Surroundings(self.gel) if pose is None else Surroundings(self.gel, pose, self.shown)

    def in_base(self, point: np.ndarray, frame: str) -> np.ndarray:
        """Transform a point (3,) m of any frame to the base frame. InputError for a frame that is not linked to it."""
        pose = self._frame(frame)
        if pose is None:
            raise InputError(f"it is in '{frame}', which nothing links to '{self.base}'")
        return (pose @ [*point, 1.0])[:3]

    def _frame(self, name: str) -> np.ndarray | None:
        try:
            return self._transforms.newest(self.base, name)
        except TransformError:
            return None

    def _gel_at(self, stamp: int) -> np.ndarray | None:
        return self._transforms.known(self.base, self._sensor, stamp)

    def _on_modes(self, modes: PoseModes) -> None:
        try:
            poses_from_msgs([mode.pose.pose for mode in modes.modes])
        except InputError as error:
            self._problem("bad_modes", f"pose_modes: {error}")
        else:
            self._modes = modes

    def _on_mesh(self, markers: MarkerArray) -> None:
        """Take the mesh that the filter believes in; its earlier hypotheses were about another one."""
        for marker in markers.markers:
            if marker.action == Marker.ADD and marker.mesh_resource:
                self._modes = PoseModes()
                try:
                    self._mesh = load_mesh(marker.mesh_resource)
                except InputError as error:
                    self._mesh = None
                    self._problem("bad_meshes", f"object_mesh: {error}")
