from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from fake_kernel import picture

from digit_driver.camera_model import CameraModel, decode
from digit_driver.frames import CorruptFrameError
from digit_driver.videodev2 import PIX_FMT_MJPEG, PIX_FMT_YUYV
from midastouch_common.errors import InputError

OWN = {
    "label": "MyTouch",
    "usb_ids": ["1BCF:2b98"],
    "rotation": 180,
    "modes": {"small": {"width": 640, "height": 480, "fps": [30, 15], "crop": [100, 50, 400, 300]}},
}


def with_mode(**changes) -> dict:
    """A change of the modes to one."""
    return {"modes": {"a": {"width": 640, "height": 480, "fps": [30], **changes}}}


def written(tmp_path: Path, content) -> Path:
    path = tmp_path / "my_touch.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_digit() -> None:
    digit = CameraModel.load("digit")
    assert (digit.label, digit.usb_ids, digit.rotation, digit.leds) == ("DIGIT", (("2833", "0209"),), 90, True)
    qvga, vga = digit.mode(""), digit.mode("VGA")
    assert (qvga.width, qvga.height, qvga.fps, qvga.output) == (320, 240, (60, 30), (240, 320))
    assert (vga.fps, vga.output, vga.pixel_format) == ((30, 15), (480, 640), PIX_FMT_YUYV)
    assert qvga.reduction == 1


def test_a_gelsight_mini_shows_the_middle_part_in_portrait() -> None:
    mini = CameraModel.load("gelsight_mini")
    mode = mini.mode("")
    assert (mode.width, mode.height, mode.pixel_format, mode.output) == (3280, 2464, PIX_FMT_MJPEG, (240, 320))
    assert not mini.leds
    column, row, width, height = mode.crop
    assert width / height == pytest.approx(4 / 3, rel=3e-3)
    assert (column + width / 2, row + height / 2) == pytest.approx((1640, 1232), abs=1)
    assert mode.reduction == 4, "half of that would be smaller than what is published"


def test_one_s_own(tmp_path) -> None:
    model = CameraModel.load(written(tmp_path, OWN))
    assert model.usb_ids == (("1bcf", "2b98"),)
    mode = model.mode("small")
    assert (mode.crop, mode.output, mode.pixel_format) == ((100, 50, 400, 300), (400, 300), PIX_FMT_YUYV)
    assert not model.leds


@pytest.mark.parametrize(("rotation", "corner"), [(0, (0, 0)), (90, (-1, 0)), (180, (-1, -1)), (270, (0, -1))], ids=str)
@pytest.mark.parametrize("reduction", [1, 2])
def test_images_are_cropped_then_turned_then_scaled(tmp_path, rotation, corner, reduction) -> None:
    """The top left corner of the part that is used lies where the rotation, counter-clockwise, brings it."""
    output = [100, 80] if rotation in (0, 180) else [80, 100]
    mode = OWN["modes"]["small"] | {"crop": [100, 50, 400, 320], "output": output}
    model = CameraModel.load(written(tmp_path, OWN | {"rotation": rotation, "modes": {"small": mode}}))
    image = np.zeros((480, 640, 3), np.uint8)
    image[:50], image[370:], image[:, :100], image[:, 500:] = (90, 0, 0), (90, 0, 0), (90, 0, 0), (90, 0, 0)
    image[50:90, 100:140] = (10, 250, 30)
    published = model.upright(np.ascontiguousarray(image[::reduction, ::reduction]), model.mode("small"))
    assert published.shape == (output[1], output[0], 3)
    assert published.flags.c_contiguous
    assert published[..., 0].max() <= 12, "what is cut off is not seen"
    np.testing.assert_allclose(published[corner], (10, 250, 30), atol=3)
    assert (published[..., 1] > 125).sum() == pytest.approx(100, abs=25)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"label": None}, "label"),
        ({"modes": None}, "modes"),
        ({"modes": {}}, "modes"),
        ({"usb_ids": []}, "usb_ids.*product"),
        ({"usb_ids": [28330209]}, "usb_ids.*28330209"),
        ({"rotation": 45}, "rotation.*0, 90, 180, 270"),
        ({"rotatoin": 90}, "rotatoin.*rotation"),
        ({"modes": {"a": {"width": 640, "height": 480}}}, "fps"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": []}}}, "fps"),
        ({"modes": {"a": {"width": "wide", "height": 480, "fps": [30]}}}, "width.*'wide'"),
        (with_mode(format="H264"), "format.*YUYV, MJPG.*H264"),
        (with_mode(crop=[300, 0, 400, 480]), r"crop.*640x480"),
        (with_mode(output=[240]), r"output.*\[240\]"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": 30}}}, r"fps.*write \[30\]"),
        (with_mode(crop=[0, 0, 640]), r"crop.*\[0, 0, 640\]"),
        (with_mode(crop=[0, 0, 64.5, 48]), "crop.*64.5"),
        ({"leds": "false"}, "leds.*'false'.*true"),
        (dict.fromkeys(OWN), "my_touch.yaml"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, change, problem) -> None:
    content = {key: value for key, value in (OWN | change).items() if value is not None}
    with pytest.raises(InputError, match=problem) as error:
        CameraModel.load(written(tmp_path, content))
    assert "digit.yaml" in str(error.value)


def test_a_product_left_empty_is_none(tmp_path) -> None:
    path = written(tmp_path, OWN)
    path.write_text(path.read_text() + "product:\n")
    assert CameraModel.load(path).product == ""
    path.write_text(path.read_text().replace("- 1BCF:2b98", ""))
    with pytest.raises(InputError, match=r"usb_ids.*product"):
        CameraModel.load(path)


@pytest.mark.parametrize(("output", "fits"), [([300, 400], True), ([303, 400], True), ([310, 400], False)])
def test_a_pixel_stays_square_after_the_turn(tmp_path, output, fits) -> None:
    mode = OWN["modes"]["small"] | {"output": output}
    file = written(tmp_path, OWN | {"rotation": 90, "modes": {"small": mode}})
    if fits:
        assert CameraModel.load(file).mode("small").output == tuple(output)
    else:
        with pytest.raises(InputError, match=r"output.*300 x 400.*change crop or output"):
            CameraModel.load(file)


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


def test_padding_after_a_jpeg_is_harmless() -> None:
    assert decode(jpeg() + bytes(64), PIX_FMT_MJPEG, 320, 240).shape == (240, 320, 3)


NO_JPEGS = (b"", jpeg()[:-200], jpeg(640, 480), b"\xff\xd8rubbish\xff\xd9")
CORRUPT = [(picture(0)[:-2], PIX_FMT_YUYV), *((data, PIX_FMT_MJPEG) for data in NO_JPEGS)]


@pytest.mark.parametrize(("data", "kind"), CORRUPT)
def test_what_is_no_whole_image_is_corrupt(data, kind) -> None:
    with pytest.raises(CorruptFrameError):
        decode(data, kind, 320, 240)
