"""Publisher of a tactile camera's images."""

from __future__ import annotations

import array

import cv2
import numpy as np
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from midastouch_common.ros.conversions import image_to_msg
from midastouch_common.ros.node import PipelineNode

from ..camera_info import Intrinsics

IMAGE_QOS = QoSProfile(depth=2)
"""Reliable, volatile: serves best-effort subscribers as well (REP 2003)."""


class ImagePublisher:
    """Publisher of ``image_raw`` and ``image_raw/compressed``, while they have subscribers, and of ``camera_info``."""

    def __init__(self, node: PipelineNode) -> None:
        self._image = node.create_publisher(Image, "image_raw", IMAGE_QOS)
        self._jpeg = node.create_publisher(CompressedImage, "image_raw/compressed", IMAGE_QOS)
        self._info = node.create_publisher(CameraInfo, "camera_info", IMAGE_QOS)

    def publish(self, image: np.ndarray, header: Header, intrinsics: Intrinsics, jpeg_quality: int) -> None:
        """Publish an (H, W, 3) uint8 RGB image; ``jpeg_quality`` is 1...100."""
        if self._image.get_subscription_count():
            self._image.publish(image_to_msg(image, "rgb8", header))
        if self._jpeg.get_subscription_count():
            self._jpeg.publish(compressed_message(image, header, jpeg_quality))
        self._info.publish(CameraInfo(header=header, **vars(intrinsics)))  # whose fields have the same names


def compressed_message(image: np.ndarray, header: Header, quality: int) -> CompressedImage:
    """Return the JPEG of an (H, W, 3) uint8 RGB array, labelled as image_transport labels it."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    message = CompressedImage(header=header, format="rgb8; jpeg compressed bgr8")
    # array.array is the only type that rclpy takes without a check of every element.
    message.data = array.array("B", jpeg.tobytes())
    return message
