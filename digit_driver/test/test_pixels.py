import cv2
import numpy as np
import pytest
from fake_kernel import picture

from digit_driver.errors import CorruptFrameError
from digit_driver.pixels import decode
from digit_driver.videodev2 import PIX_FMT_MJPEG, PIX_FMT_YUYV


def jpeg(width: int = 320, height: int = 240) -> bytes:
    bgr = np.zeros((height, width, 3), np.uint8)
    bgr[: height // 2, width // 2 :] = (0, 0, 255)
    return cv2.imencode(".jpg", bgr)[1].tobytes()


@pytest.mark.parametrize(("data", "kind"), [(picture(0), PIX_FMT_YUYV), (jpeg(), PIX_FMT_MJPEG)])
def test_images_are_rgb_as_the_camera_has_them(data, kind) -> None:
    image = decode(data, kind, 320, 240)
    assert image.shape == (240, 320, 3)
    red = image[..., 0].astype(int) - image[..., 2] > 50
    assert red[5:115, 165:].all()
    assert not red[125:].any()
    assert not red[:, :155].any()


@pytest.mark.parametrize("reduction", [2, 4, 8])
def test_a_jpeg_may_be_reduced_while_it_is_decoded(reduction) -> None:
    image = decode(jpeg(642, 482), PIX_FMT_MJPEG, 642, 482, reduction)
    assert image.shape == (-(-482 // reduction), -(-642 // reduction), 3)
    assert image[5, -5, 0] > 200 > 50 > image[-5, 5, 0]


def test_yuyv_of_wrong_length_is_corrupt() -> None:
    with pytest.raises(CorruptFrameError, match="153600"):
        decode(picture(0)[:-2], PIX_FMT_YUYV, 320, 240)


@pytest.mark.parametrize("data", [b"", jpeg()[:-200], jpeg(640, 480), b"\xff\xd8rubbish\xff\xd9"])
def test_bad_jpeg_is_corrupt(data) -> None:
    with pytest.raises(CorruptFrameError):
        decode(data, PIX_FMT_MJPEG, 320, 240)


def test_padding_after_a_jpeg_is_harmless() -> None:
    assert decode(jpeg() + bytes(64), PIX_FMT_MJPEG, 320, 240).shape == (240, 320, 3)
