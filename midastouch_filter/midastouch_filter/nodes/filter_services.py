"""Services of the filter node, nav2's two for a localiser and `set_object`, and the topics that give a start."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import Empty

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import covariance_from_msg, pose_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.managed_node import INACTIVE
from midastouch_common.ros.parameters import Parameters
from midastouch_common.ros.services import offer
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.srv import SetObject

from ..localiser import Localiser, Start, spread_of


class FilterServices:
    """Services for a node's localiser; while the node is not active (localiser None), they report that.

    `change_object(mesh, codebook)` raises InputError if the node keeps the old object.
    """

    def __init__(
        self, node: Node, localiser: Callable[[], Localiser | None], change_object: Callable[[str, str], None]
    ):
        self._log, self._localiser, self._change_object = node.get_logger(), localiser, change_object
        node.create_service(Empty, "reinitialize_global_localization", self._on_reinitialize)
        node.create_service(Empty, "request_nomotion_update", self._on_nomotion_update)
        offer(node, SetObject, "set_object", self._on_set_object)

    def _on_reinitialize(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        if (localiser := self._active("reinitialize_global_localization")) is not None:
            localiser.start_anywhere()
        return response

    def _on_nomotion_update(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        localiser = self._active("request_nomotion_update")
        if localiser is not None and localiser.filter is not None:
            localiser.filter.force_update()
        return response

    def _on_set_object(self, request: SetObject.Request) -> None:
        if self._active("set_object") is None:
            raise InputError(INACTIVE)
        self._change_object(request.mesh_path, request.codebook_path)

    def _active(self, service: str) -> Localiser | None:
        localiser = self._localiser()
        if localiser is None:
            self._log.warning(f"{service}: {INACTIVE}")
        return localiser


class StartTopics:
    """Subscriptions to both topics for a localiser; `on_bad(kind, reason)` is called for poses that cannot be used.

    `initialpose` is the gel frame's pose, in the object's frame or, once the object's pose is known, in any
    other; `object_pose_prior` is the object's pose in any frame. Both are taken at the newest transform: stamps
    of poses made by hand are often of another clock.
    """

    def __init__(
        self,
        node: Node,
        parameters: Parameters,
        localiser: Localiser,
        transforms: TransformSource,
        on_bad: Callable[[str, str], None],
    ):
        self._log = node.get_logger()
        self._base, self._object = parameters["base_frame_id"], parameters["object_frame_id"]
        self._localiser, self._transforms, self._on_bad = localiser, transforms, on_bad
        for topic, use in (("initialpose", self._start_at), ("object_pose_prior", self._expect_object)):
            node.create_subscription(PoseWithCovarianceStamped, topic, partial(self._on_pose, topic, use), qos.COMMAND)

    def _on_pose(self, topic: str, use: Callable, msg: PoseWithCovarianceStamped) -> None:
        try:
            if self._localiser.object is None:
                raise InputError(self._localiser.waiting_for)
            covariance = covariance_from_msg(msg.pose.covariance)
            spread = spread_of(covariance, self._localiser.object.diagonal)
            use(msg.header.frame_id.lstrip("/"), pose_from_msg(msg.pose.pose), *spread)
        except (InputError, TransformError) as error:
            self._on_bad(f"bad_{topic}", f"{topic}: {error}")
        else:
            self._log.info(f"{topic}: within {1e3 * spread[0]:.1f} mm, {math.degrees(spread[1]):.0f} deg")

    def _start_at(self, frame: str, pose: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        if frame != self._object:
            T_base_obj = self._localiser.T_base_obj()
            if T_base_obj is None:
                raise InputError(
                    f"pose in frame '{frame}', but where the object is, is not known (not converged); "
                    f"give it in frame '{self._object}'"
                )
            pose = se3.inverse(T_base_obj) @ self._in_base(frame) @ pose
        self._localiser.start_at(Start(pose, sigma_t, sigma_r))

    def _expect_object(self, frame: str, pose: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        self._localiser.expect_object_at(self._in_base(frame) @ pose, sigma_t, sigma_r)

    def _in_base(self, frame: str) -> np.ndarray:
        """Return the newest T_base_frame (4, 4)."""
        if not frame:
            raise InputError("header.frame_id is empty; name the frame that the pose is in")
        if frame == self._base:
            return np.eye(4)
        return self._transforms.newest(self._base, frame)
