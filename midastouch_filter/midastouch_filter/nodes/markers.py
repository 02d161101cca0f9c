"""Messages that show the filter in RViz and Foxglove: pure functions of arrays.

All of them are in the object's frame, metres. Finite input gives finite output; the caller checks its input.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, PoseArray, Vector3
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common import se3
from midastouch_common.ros.conversions import points_to_msg, pose_to_msg, poses_to_msgs

MAX_POSES = 1000
_LONGEST_LIFETIME = 2.0**31 - 1  # s; the message holds no more
_AXIS_LENGTH = 0.01
_AXIS_COLOURS = (
    ColorRGBA(r=0.9, g=0.2, b=0.2, a=1.0),
    ColorRGBA(r=0.2, g=0.8, b=0.2, a=1.0),
    ColorRGBA(r=0.2, g=0.4, b=0.95, a=1.0),
)


def drawn_by_weight(weights: np.ndarray, n: int) -> np.ndarray:
    """Return indices (at most n) of particles drawn by weights (N,): systematic, the same for the same input.

    Each particle appears in proportion to its weight; no more are drawn than there are particles.
    """
    n = min(n, len(weights))
    cumulative = np.cumsum(weights)
    return np.searchsorted(cumulative, (np.arange(n) + 0.5) / n * cumulative[-1])


def particle_poses(poses: np.ndarray, weights: np.ndarray, header: Header) -> PoseArray:
    """Return at most `MAX_POSES` particles (N, 4, 4), drawn by weight: rclpy needs microseconds per pose."""
    drawn = poses[drawn_by_weight(weights, MAX_POSES)]
    return PoseArray(header=header, poses=poses_to_msgs(drawn))


def particle_cloud(poses: np.ndarray, weights: np.ndarray, header: Header) -> PointCloud2:
    """Return all particles (N, 4, 4): position, gel normal (normal_x, _y, _z), `intensity`: weight over 1/N."""
    normals = poses[:, :3, 2]
    return points_to_msg(
        poses[:, :3, 3],
        header,
        intensity=weights * len(weights),
        normal_x=normals[:, 0],
        normal_y=normals[:, 1],
        normal_z=normals[:, 2],
    )


def object_mesh(resource: str, header: Header) -> MarkerArray:
    """Return markers that remove the last object and show a mesh (a `file://` or `package://` address)."""
    mesh = Marker(
        header=header,
        ns="object_mesh",
        id=0,
        type=Marker.MESH_RESOURCE,
        action=Marker.ADD,
        mesh_resource=resource,
        mesh_use_embedded_materials=True,
        scale=Vector3(x=1.0, y=1.0, z=1.0),
        color=ColorRGBA(r=0.75, g=0.75, b=0.78, a=0.6),
    )
    mesh.pose.orientation.w = 1.0
    return MarkerArray(markers=[Marker(header=header, ns="object_mesh", action=Marker.DELETEALL), mesh])


def cleared_hypotheses(header: Header) -> MarkerArray:
    """Return markers that remove those of `hypotheses`."""
    names = ("modes", "mode_axes", "mode_mass")
    return MarkerArray(markers=[Marker(header=header, ns=name, action=Marker.DELETEALL) for name in names])


def hypotheses(modes: Sequence, header: Header, lifetime: float) -> MarkerArray:
    """Draw modes (weight, pose (4, 4), covariance (6, 6)), heaviest first, for `lifetime` seconds.

    `modes`: two-sigma ellipsoids of the position, the dominant one green, lighter ones fainter; `mode_axes`:
    the gel's axes at each mode; `mode_mass`: its fraction of the probability as text.
    """
    markers = [_ellipsoid(i, mode) for i, mode in enumerate(modes)]
    markers += [_mass(i, mode) for i, mode in enumerate(modes)]
    if modes:
        markers.append(_axes(np.stack([mode.pose for mode in modes])))
    for marker in markers:
        marker.header = header
        marker.action = Marker.ADD
        marker.lifetime.sec, fraction = divmod(round(min(lifetime, _LONGEST_LIFETIME) * 1e9), 1_000_000_000)
        marker.lifetime.nanosec = fraction
    return MarkerArray(markers=markers)


def suggested(suggestions: Sequence, header: Header) -> MarkerArray:
    """Draw suggestions (path (n, 4, 4), lift, reason), best first, in place of the last ones.

    `suggestions`: arrows along the predicted ways, the best one green, a lift as an arch; `suggestion_reasons`: text
    at their ends.
    """
    markers = [Marker(ns=name, action=Marker.DELETEALL) for name in ("suggestions", "suggestion_reasons")]
    for i, each in enumerate(suggestions):
        if len(each.path) == 0:
            continue
        way = each.path[:, :3, 3]
        if each.lift:
            way = np.insert(way, 1, way.mean(axis=0) + _AXIS_LENGTH * each.path[:, :3, 2].mean(axis=0), axis=0)
        markers += [_way(i, way), _tip(i, way), _reason(i, each, way[-1])]
    for marker in markers:
        marker.header = header
    return MarkerArray(markers=markers)


def _way(index: int, way: np.ndarray) -> Marker:
    marker = Marker(ns="suggestions", id=2 * index, type=Marker.LINE_STRIP, scale=Vector3(x=0.0015))
    marker.pose.orientation.w, marker.color = 1.0, _rank_colour(index)
    marker.points = [_point(xyz) for xyz in way]
    return marker


def _tip(index: int, way: np.ndarray) -> Marker:
    marker = Marker(ns="suggestions", id=2 * index + 1, type=Marker.ARROW, scale=Vector3(x=0.0015, y=0.005, z=0.006))
    marker.pose.orientation.w, marker.color = 1.0, _rank_colour(index)
    marker.points = [_point(xyz) for xyz in way[-2:]]
    return marker


def _reason(index: int, suggestion, tip: np.ndarray) -> Marker:
    marker = Marker(
        ns="suggestion_reasons",
        id=index,
        type=Marker.TEXT_VIEW_FACING,
        text=suggestion.reason,
        scale=Vector3(z=0.004),
        color=ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0),
    )
    marker.pose.position = _point(tip + _AXIS_LENGTH * suggestion.path[-1, :3, 2])
    marker.pose.orientation.w = 1.0
    return marker


def _rank_colour(index: int) -> ColorRGBA:
    return ColorRGBA(r=0.1, g=0.75, b=0.2, a=1.0) if index == 0 else ColorRGBA(r=0.95, g=0.6, b=0.1, a=0.6)


def _ellipsoid(index: int, mode) -> Marker:
    variances, directions = np.linalg.eigh(mode.covariance[:3, :3])
    if np.linalg.det(directions) < 0:
        directions[:, 0] *= -1
    # RViz draws nothing with a zero scale
    diameters = 4 * np.sqrt(np.maximum(variances, 1e-8))
    x, y, z = diameters.tolist()
    dominant = index == 0
    return Marker(
        ns="modes",
        id=index,
        type=Marker.SPHERE,
        pose=pose_to_msg(se3.make(directions, mode.pose[:3, 3])),
        scale=Vector3(x=x, y=y, z=z),
        color=ColorRGBA(
            r=0.1 if dominant else 0.95,
            g=0.75 if dominant else 0.6,
            b=0.2 if dominant else 0.1,
            a=0.25 + 0.5 * float(np.clip(mode.weight, 0.0, 1.0)),
        ),
    )


def _mass(index: int, mode) -> Marker:
    marker = Marker(
        ns="mode_mass",
        id=index,
        type=Marker.TEXT_VIEW_FACING,
        text=f"{100 * mode.weight:.0f} %",
        scale=Vector3(z=0.006),
        color=ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0),
    )
    above = mode.pose[:3, 3] + 1.5 * _AXIS_LENGTH * mode.pose[:3, 2]
    marker.pose.position = _point(above)
    marker.pose.orientation.w = 1.0
    return marker


def _axes(poses: np.ndarray) -> Marker:
    marker = Marker(ns="mode_axes", id=0, type=Marker.LINE_LIST, scale=Vector3(x=0.0008))
    marker.pose.orientation.w = 1.0
    for pose in poses:
        for axis, colour in enumerate(_AXIS_COLOURS):
            tip = pose[:3, 3] + _AXIS_LENGTH * pose[:3, axis]
            marker.points += [_point(pose[:3, 3]), _point(tip)]
            marker.colors += [colour, colour]
    return marker


def _point(xyz: np.ndarray) -> Point:
    x, y, z = map(float, xyz)
    return Point(x=x, y=y, z=z)
