from __future__ import annotations

import numpy as np
import pytest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from midastouch_common import se3
from midastouch_common.message_arrays import points_from_msg
from midastouch_filter.core.estimate import Mode
from midastouch_filter.nodes import markers

HEADER = Header(frame_id="object")


def poses(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return se3.make(se3.random_rotations(n, rng), rng.normal(0, 0.05, (n, 3)))


def test_drawing_is_proportional_to_weight_and_repeatable():
    weights = np.array([0.5, 0.25, 0.25, 0.0])
    assert markers.drawn_by_weight(weights, 4).tolist() == [0, 0, 1, 2]
    many = np.random.default_rng(0).random(5000)
    many /= many.sum()
    drawn = markers.drawn_by_weight(many, 1000)
    counts = np.bincount(drawn, minlength=5000)
    assert np.abs(counts - 1000 * many).max() <= 1
    np.testing.assert_array_equal(drawn, markers.drawn_by_weight(many, 1000))


def test_cloud_holds_all_particles_with_weights():
    p, weights = poses(4), np.array([0.4, 0.3, 0.2, 0.1])
    cloud = markers.particle_cloud(p, weights, HEADER)
    np.testing.assert_allclose(points_from_msg(cloud), p[:, :3, 3].astype(np.float32))
    columns = np.frombuffer(cloud.data, np.float32).reshape(4, -1)
    names = [f.name for f in cloud.fields]
    np.testing.assert_allclose(columns[:, names.index("intensity")], 4 * weights, rtol=1e-6)
    np.testing.assert_allclose(columns[:, names.index("normal_z")], p[:, 2, 2], rtol=1e-6)


def test_hypotheses_have_unique_names_and_finite_sizes():
    covariance = np.zeros((6, 6))
    covariance[0, 0] = 1e-6
    modes = [Mode(0.8, poses(1)[0], covariance, 10), Mode(0.2, poses(1, 1)[0], covariance, 3)]
    array = markers.hypotheses(modes, HEADER, lifetime=1.5)
    names = [(m.ns, m.id) for m in array.markers]
    assert len(set(names)) == len(names) == 5
    for marker in array.markers:
        assert marker.header.frame_id == "object"
        assert marker.action == Marker.ADD
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (1, 500_000_000)
    ellipsoid = next(m for m in array.markers if m.ns == "modes" and m.id == 0)
    sizes = sorted([ellipsoid.scale.x, ellipsoid.scale.y, ellipsoid.scale.z])
    assert sizes == pytest.approx([4e-4, 4e-4, 4e-3]), "two sigma to each side; never zero"
    axes = next(m for m in array.markers if m.ns == "mode_axes")
    assert len(axes.points) == len(axes.colors) == 12
    assert next(m for m in array.markers if m.ns == "mode_mass").text == "80 %"


def test_ellipsoid_points_along_its_covariance():
    direction = np.array([1.0, 2.0, -2.0]) / 3
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = 1e-6 * np.outer(direction, direction)
    (ellipsoid,) = [
        m for m in markers.hypotheses([Mode(1.0, np.eye(4), covariance, 1)], HEADER, 1.0).markers if m.ns == "modes"
    ]
    q = ellipsoid.pose.orientation
    rotation = se3.from_xyzquat(np.array([0, 0, 0, q.x, q.y, q.z, q.w]))[:3, :3]
    longest = rotation[:, int(np.argmax([ellipsoid.scale.x, ellipsoid.scale.y, ellipsoid.scale.z]))]
    assert abs(longest @ direction) == pytest.approx(1.0)


def test_mesh_replaces_what_was_shown():
    delete, add = markers.object_mesh("file:///thing.ply", HEADER).markers
    assert (delete.action, delete.ns) == (Marker.DELETEALL, "object_mesh")
    assert (add.action, add.type, add.mesh_resource) == (Marker.ADD, Marker.MESH_RESOURCE, "file:///thing.ply")
    assert (add.scale.x, add.pose.orientation.w) == (1.0, 1.0)
    assert {m.action for m in markers.cleared_hypotheses(HEADER).markers} == {Marker.DELETEALL}


def test_a_marker_stays_no_longer_than_a_message_can_say():
    array = markers.hypotheses([Mode(1.0, np.eye(4), np.eye(6), 10)], HEADER, lifetime=np.inf)
    assert {marker.lifetime.sec for marker in array.markers} == {2**31 - 1}
