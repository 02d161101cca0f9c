from __future__ import annotations

import array

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Header
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose

from midastouch_common import message_arrays as arrays
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.ros import conversions as c

HEADER = Header(frame_id="somewhere")


def image(encoding: str, rng: np.random.Generator, height: int = 5, width: int = 4) -> np.ndarray:
    if encoding == "32FC1":
        return rng.random((height, width), np.float32)
    shape = (height, width) if encoding == "mono8" else (height, width, 3)
    return rng.integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8", "32FC1"])
def test_image_round_trip(encoding):
    pixels = image(encoding, np.random.default_rng(0))
    msg = c.image_to_msg(pixels, encoding, HEADER)
    assert isinstance(msg.data, array.array)
    assert (msg.height, msg.width, msg.header.frame_id) == (5, 4, "somewhere")
    np.testing.assert_array_equal(arrays.image_from_msg(msg), pixels)


def test_image_with_padded_rows_and_foreign_byte_order():
    pixels = image("32FC1", np.random.default_rng(1))
    msg = c.image_to_msg(pixels, "32FC1", HEADER)
    padded = np.zeros((5, msg.step + 6), np.uint8)
    padded[:, : msg.step] = pixels.byteswap().view(np.uint8).reshape(5, -1)
    msg.step, msg.data, msg.is_bigendian = padded.shape[1], array.array("B", padded.tobytes()), 1
    np.testing.assert_array_equal(arrays.image_from_msg(msg), pixels)


@pytest.mark.parametrize("encoding", ["bgr8", "rgba8", "bgra8"])
def test_other_colours_become_rgb(encoding):
    red, green, blue = (encoding.index(letter) for letter in "rgb")
    pixels = np.random.default_rng(2).integers(0, 256, (5, 4, len(encoding) - 1), np.uint8)
    rgb = arrays.rgb_from_msg(c.image_to_msg(pixels, encoding, HEADER), 5, 4)
    np.testing.assert_array_equal(rgb, pixels[:, :, [red, green, blue]])
    assert rgb.flags.c_contiguous


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"encoding": "16UC1"}, "encoding '16UC1'"),
        ({"encoding": "rgb16"}, "rgb8.*bgr8"),
        ({"height": 6}, "holds"),
        ({"step": 3}, "holds"),
        ({"height": 0}, "empty"),
        ({"data": array.array("B", b"\0" * 59)}, "59 bytes"),
    ],
)
def test_images_that_lie_are_refused(change, complaint):
    msg = c.image_to_msg(image("rgb8", np.random.default_rng(3)), "rgb8", HEADER)
    for name, value in change.items():
        setattr(msg, name, value)
    with pytest.raises(InputError, match=complaint):
        arrays.rgb_from_msg(msg, 5, 4)


def test_landscape_image_is_refused_with_the_fix():
    msg = c.image_to_msg(image("rgb8", np.random.default_rng(3), height=4, width=5), "rgb8", HEADER)
    with pytest.raises(InputError, match="rotate it to portrait"):
        arrays.rgb_from_msg(msg, 5, 4)


@pytest.mark.parametrize("n", [0, 1, 1000])
def test_cloud_round_trip(n):
    points = np.random.default_rng(4).normal(size=(n, 3)).astype(np.float32)
    msg = c.points_to_msg(points, HEADER, intensity=np.arange(n))
    assert (msg.width, msg.height, msg.point_step, msg.is_dense) == (n, 1, 16, True)
    assert isinstance(msg.data, array.array)
    np.testing.assert_array_equal(arrays.points_from_msg(msg), points)


def test_cloud_that_is_organised_padded_and_big_endian():
    points = np.random.default_rng(5).normal(size=(2, 3, 3)).astype(">f4")
    msg = c.points_to_msg(np.zeros((6, 3)), HEADER)
    rows = np.zeros((2, 3 * 12 + 8), np.uint8)
    rows[:, :36] = np.frombuffer(points.tobytes(), np.uint8).reshape(2, 36)
    msg.height, msg.width, msg.row_step, msg.is_bigendian = 2, 3, 44, True
    msg.data = array.array("B", rows.tobytes())
    np.testing.assert_array_equal(arrays.points_from_msg(msg), points.reshape(6, 3).astype(np.float32))


def _cloud(**changes) -> PointCloud2:
    msg = c.points_to_msg(np.ones((4, 3)), HEADER)
    for name, value in changes.items():
        setattr(msg, name, value)
    return msg


@pytest.mark.parametrize(
    ("msg", "complaint"),
    [
        (_cloud(fields=[]), "x, y, z"),
        (_cloud(point_step=8, row_step=32, data=array.array("B", bytes(32))), "inside its point_step"),
        (_cloud(width=5), "row_step"),
        (_cloud(data=array.array("B", bytes(40))), "holds 40 bytes"),
        (_cloud(point_step=0), "point_step 0"),
        (_cloud(width=0, row_step=0, point_step=2**32 - 1, data=array.array("B")), "point_step 4294967295"),
        (c.points_to_msg(np.full((1, 3), np.nan), HEADER), "non-finite"),
        (PointCloud2(), "point_step 0"),
    ],
)
def test_clouds_that_lie_are_refused(msg, complaint):
    with pytest.raises(InputError, match=complaint):
        arrays.points_from_msg(msg)


def test_poses_and_transforms_round_trip():
    rng = np.random.default_rng(6)
    poses = se3.make(se3.random_rotations(20, rng), rng.normal(size=(20, 3)))
    for pose, msg in zip(poses, c.poses_to_msgs(poses), strict=True):
        np.testing.assert_allclose(arrays.pose_from_msg(msg), pose, atol=1e-12)
        np.testing.assert_allclose(arrays.transform_from_msg(c.transform_to_msg(pose)), pose, atol=1e-12)


def test_a_pose_without_rotation_is_refused():
    msg = Pose()
    msg.orientation.w = 0.0
    with pytest.raises(InputError, match="zero quaternion"):
        arrays.pose_from_msg(msg)


def test_covariance_must_be_finite_without_negative_variance():
    values = np.eye(6).ravel()
    np.testing.assert_array_equal(arrays.covariance_from_msg(values), np.eye(6))
    for bad in (np.nan, -1.0):
        values[7] = bad
        with pytest.raises(InputError, match="covariance"):
            arrays.covariance_from_msg(values)


def test_stamps_round_trip_to_the_nanosecond():
    for nanoseconds in (0, 1, 1_700_000_000_123_456_789):
        assert arrays.stamp_ns(c.stamp_from_ns(nanoseconds)) == nanoseconds


def test_stamps_beyond_a_messages_range_are_the_nearest_in_it():
    """A message may say more nanoseconds than a second has, and so lie beyond its own range."""
    latest = arrays.stamp_ns(Time(sec=2**31 - 1, nanosec=2**32 - 1))
    assert c.stamp_from_ns(latest).sec == 2**31 - 1
    assert c.stamp_from_ns(-(10**30)).sec == -(2**31)


def test_empty_image_message_is_refused():
    with pytest.raises(InputError):
        arrays.image_from_msg(Image())


def detections(*found: tuple[str, float]) -> Detection3DArray:
    results = [ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id=name, score=p)) for name, p in found]
    return Detection3DArray(detections=[Detection3D(results=[each]) for each in results])


def test_probabilities_of_objects_are_by_name():
    assert arrays.probabilities_from_msg(detections(("mug", 0.75), ("unknown", 0.25))) == {"mug": 0.75, "unknown": 0.25}
    assert arrays.probabilities_from_msg(detections(("mug", 1.0 + 1e-12))) == {"mug": pytest.approx(1.0)}
    assert arrays.probabilities_from_msg(detections()) == {}


@pytest.mark.parametrize("score", [-0.1, 1.1, np.nan])
def test_what_is_no_probability_is_refused(score):
    with pytest.raises(InputError, match="no probability"):
        arrays.probabilities_from_msg(detections(("mug", score)))


def test_a_detection_without_a_hypothesis_is_refused():
    with pytest.raises(InputError, match="no hypothesis"):
        arrays.probabilities_from_msg(Detection3DArray(detections=[Detection3D()]))
