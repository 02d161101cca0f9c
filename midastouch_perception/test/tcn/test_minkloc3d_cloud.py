import numpy as np
import pytest

from midastouch_perception.tcn.minkloc3d_cloud import contact_cloud, scaled_cloud

POINTS = 4096


def touched(rows: slice, depth: float = 1e-3) -> np.ndarray:
    """A map (160, 120) pressed `depth` m in these rows."""
    penetration = np.zeros((160, 120), np.float32)
    penetration[rows] = depth
    return penetration


def test_a_small_contact_gives_every_image_pixel_once(sensor):
    cloud = contact_cloud(touched(slice(80, 84)), sensor, POINTS, np.random.default_rng(0))
    assert cloud.shape == (4 * 4 * 120, 3)
    assert len(np.unique(cloud, axis=0)) == len(cloud)


def test_points_lie_where_the_camera_sees_the_pressed_gel(sensor):
    cloud = contact_cloud(touched(slice(0, 160)), sensor, 10**6, np.random.default_rng(0))
    depth = sensor.gel_depth - 1e-3
    expected = np.stack([sensor.rays[0] * depth, sensor.rays[1] * depth, -depth], axis=2)
    np.testing.assert_allclose(cloud.reshape(320, 240, 3), expected, atol=1e-7)


def test_points_are_drawn_without_preference(sensor):
    """The official code would have three in four of them in the lower half."""
    cloud = contact_cloud(touched(slice(0, 160)), sensor, POINTS, np.random.default_rng(0))
    assert len(cloud) == len(np.unique(cloud, axis=0)) == POINTS
    assert np.mean(cloud[:, 1] > 0) == pytest.approx(0.5, abs=0.03)


def test_the_scale_is_joint_and_the_range_full():
    cloud = np.array([[-0.01, 0.0, -0.02], [0.005, 0.01, -0.021]], np.float32)
    scaled = scaled_cloud(cloud)
    assert (scaled.min(), scaled.max()) == (-1, 1)
    np.testing.assert_allclose(scaled[1] - scaled[0], (cloud[1] - cloud[0]) * 2 / 0.031, atol=1e-6)


def test_scaling_is_the_official_one(shared):
    with np.load(shared / "reference" / "minkloc3d" / "tactile24_q0.01.npz") as data:
        clouds, official = data["clouds_m"], data["clouds_n"]
    ours = np.stack([scaled_cloud(cloud) for cloud in clouds])
    np.testing.assert_array_equal(ours, official)
