"""From the driver's own types to ROS messages. Nothing is decided here."""

from __future__ import annotations

import array

import cv2
import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from ..camera_info import Calibration
from ..health_report import HealthReport


def time_message(wall_ns: int) -> Time:
    seconds, nanoseconds = divmod(wall_ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)


def image_message(image: np.ndarray, header: Header) -> Image:
    """rgb8 Image of an (H, W, 3) uint8 array."""
    height, width, channels = image.shape
    message = Image(header=header, height=height, width=width, encoding="rgb8", step=width * channels)
    # array.array is the one type rclpy takes without looking at every element.
    message.data = array.array("B", image.tobytes())
    return message


def compressed_message(image: np.ndarray, header: Header, quality: int) -> CompressedImage:
    """JPEG of an (H, W, 3) uint8 RGB array, labelled as image_transport labels it."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    message = CompressedImage(header=header, format="rgb8; jpeg compressed bgr8")
    message.data = array.array("B", jpeg.tobytes())
    return message


def camera_info_message(calibration: Calibration, header: Header) -> CameraInfo:
    return CameraInfo(
        header=header,
        width=calibration.width,
        height=calibration.height,
        distortion_model=calibration.distortion_model,
        d=list(calibration.d),
        k=list(calibration.k),
        r=list(calibration.r),
        p=list(calibration.p),
    )


def diagnostics_message(report: HealthReport, name: str, hardware_id: str, stamp: Time) -> DiagnosticArray:
    status = DiagnosticStatus(
        level=bytes([report.level]),
        name=name,
        message=report.message,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=value) for key, value in report.values.items()],
    )
    return DiagnosticArray(header=Header(stamp=stamp), status=[status])
