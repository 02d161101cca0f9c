"""The driver's images on their topics."""

from __future__ import annotations

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from ..camera_info import Calibration
from . import messages

IMAGE_QOS = QoSProfile(depth=2)
"""Reliable, volatile: serves best-effort subscribers as well (REP 2003)."""


class ImagePublisher:
    """Publishes ``image_raw`` and ``image_raw/compressed`` while somebody listens, and ``camera_info``."""

    def __init__(self, node: Node) -> None:
        options = {"qos_overriding_options": QoSOverridingOptions.with_default_policies()}
        self._image = node.create_publisher(Image, "image_raw", IMAGE_QOS, **options)
        self._jpeg = node.create_publisher(CompressedImage, "image_raw/compressed", IMAGE_QOS, **options)
        self._info = node.create_publisher(CameraInfo, "camera_info", IMAGE_QOS, **options)

    def publish(self, image: np.ndarray, header: Header, calibration: Calibration | None, jpeg_quality: int) -> None:
        """Publishes an (H, W, 3) uint8 RGB image; ``jpeg_quality`` is 1...100."""
        if self._image.get_subscription_count():
            self._image.publish(messages.image_message(image, header))
        if self._jpeg.get_subscription_count():
            self._jpeg.publish(messages.compressed_message(image, header, jpeg_quality))
        self._info.publish(messages.camera_info_message(calibration, header))
