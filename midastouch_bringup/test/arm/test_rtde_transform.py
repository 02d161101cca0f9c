import numpy as np
import pytest

from midastouch_bringup.arm.rtde_transform import BASE_LINK_FROM_BASE, tool_from_tcp, transform_from_rtde
from midastouch_common import se3
from midastouch_common.errors import InputError


def test_rotation_vector_is_axis_times_angle():
    transform = transform_from_rtde([0.1, -0.2, 0.3, 0.0, 0.0, np.pi / 2])
    expected = np.array([[0, -1, 0, 0.1], [1, 0, 0, -0.2], [0, 0, 1, 0.3], [0, 0, 0, 1.0]])
    np.testing.assert_allclose(transform, expected, atol=1e-15)


def test_tool_pointing_down_as_the_teach_pendant_shows_it():
    # rx = pi: z of the tool points to the floor, x stays
    transform = transform_from_rtde([0.4, 0.0, 0.2, np.pi, 0.0, 0.0])
    np.testing.assert_allclose(transform[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-4, 1.0, np.pi - 1e-9, np.pi, 1.5 * np.pi])
def test_any_angle_gives_a_rotation_of_that_angle(angle):
    rotation = transform_from_rtde([0, 0, 0, *(angle * np.array([0.6, 0.0, 0.8]))])[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    expected = np.pi - abs(angle % (2 * np.pi) - np.pi)
    assert se3.rotation_angle(rotation) == pytest.approx(expected, abs=1e-8)


def test_batches_keep_their_shape():
    poses = np.random.default_rng(0).uniform(-1, 1, (3, 2, 6))
    batch = transform_from_rtde(poses)
    assert batch.shape == (3, 2, 4, 4)
    np.testing.assert_array_equal(batch[2, 1], transform_from_rtde(poses[2, 1]))


def test_tcp_offset_is_taken_off():
    rng = np.random.default_rng(1)
    tool, offset = rng.uniform(-1, 1, 6), np.array([0.0, 0.01, 0.12, 0.0, 0.3, 0.0])
    tcp = transform_from_rtde(tool) @ transform_from_rtde(offset)
    recovered = tool_from_tcp(np.concatenate([tcp[:3, 3], se3.log(tcp)[3:]]), offset)
    np.testing.assert_allclose(recovered, transform_from_rtde(tool), atol=1e-12)


def test_without_an_offset_the_tcp_is_tool0():
    pose = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    np.testing.assert_allclose(tool_from_tcp(pose, np.zeros(6)), transform_from_rtde(pose), atol=1e-15)


def test_base_is_base_link_turned_by_half_a_turn():
    np.testing.assert_allclose(BASE_LINK_FROM_BASE, transform_from_rtde([0, 0, 0, 0, 0, np.pi]), atol=1e-15)


@pytest.mark.parametrize(
    ("pose", "message"),
    [([0.0] * 7, "6 values"), ([np.nan, 0, 0, 0, 0, 0], "non-finite"), ([np.inf] * 6, "non-finite")],
)
def test_bad_poses_are_refused(pose, message):
    with pytest.raises(InputError, match=message):
        transform_from_rtde(pose)
