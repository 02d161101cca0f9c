from pathlib import Path

import numpy as np
import pytest
import yaml

from digit_driver import camera_model
from digit_driver.camera_model import CameraModel
from digit_driver.videodev2 import PIX_FMT_MJPEG, PIX_FMT_YUYV
from midastouch_common.errors import InputError

OWN = {
    "label": "MyTouch",
    "usb_ids": ["1BCF:2b98"],
    "rotation": 180,
    "modes": {"small": {"width": 640, "height": 480, "fps": [30, 15], "crop": [100, 50, 400, 300]}},
}


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


def test_a_gelsight_mini_shows_the_middle_of_its_image_in_portrait() -> None:
    mini = CameraModel.load("gelsight_mini")
    mode = mini.mode("")
    assert (mode.width, mode.height, mode.pixel_format, mode.output) == (3280, 2464, PIX_FMT_MJPEG, (240, 320))
    assert not mini.leds
    column, row, width, height = mode.crop
    assert width / height == pytest.approx(4 / 3, rel=3e-3)
    assert (column + width / 2, row + height / 2) == pytest.approx((1640, 1232), abs=1)
    assert mode.reduction == 4, "half of that would be smaller than what is published"


def test_every_shipped_model_can_be_read() -> None:
    for path in (Path(camera_model.__file__).parent / "cameras").glob("*.yaml"):
        assert CameraModel.load(path.stem).modes


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
        ({"label": None}, "has no label"),
        ({"modes": None}, "has no modes"),
        ({"modes": {}}, "modes is empty"),
        ({"usb_ids": []}, "nothing tells the sensor"),
        ({"usb_ids": [28330209]}, "not vendor:product"),
        ({"rotation": 45}, "rotation must be one of 0, 90, 180, 270"),
        ({"rotatoin": 90}, "unknown: rotatoin"),
        ({"modes": {"a": {"width": 640, "height": 480}}}, "has no fps"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": []}}}, "fps is empty"),
        ({"modes": {"a": {"width": "wide", "height": 480, "fps": [30]}}}, "width: 'wide' is not a whole number"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "format": "H264"}}}, "one of YUYV, MJPG, got H264"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "crop": [300, 0, 400, 480]}}}, "leaves the image"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "output": [240]}}}, "not a width and a height"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "output": [320, 320]}}}, "pixel must stay square"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": 30}}}, r"fps: 30 is not a list; write \[30\]"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "crop": [0, 0, 640]}}}, "crop .* is not a column"),
        ({"modes": {"a": {"width": 640, "height": 480, "fps": [30], "crop": [0, 0, 64.5, 48]}}}, "crop: 64.5 is not"),
        ({"leds": "false"}, "leds: 'false' is neither true nor false"),
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
    with pytest.raises(InputError, match="nothing tells the sensor"):
        CameraModel.load(path)


@pytest.mark.parametrize(("output", "fits"), [([300, 400], True), ([303, 400], True), ([310, 400], False)])
def test_a_pixel_stays_square_after_the_turn(tmp_path, output, fits) -> None:
    mode = OWN["modes"]["small"] | {"output": output}
    file = written(tmp_path, OWN | {"rotation": 90, "modes": {"small": mode}})
    if fits:
        assert CameraModel.load(file).mode("small").output == tuple(output)
    else:
        with pytest.raises(InputError, match="turned 300 x 400: a pixel must stay square"):
            CameraModel.load(file)


@pytest.mark.parametrize("text", ["", "- 1", "label: [", "{"])
def test_what_is_no_camera_model(tmp_path, text) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"broken\.yaml"):
        CameraModel.load(path)


def test_unknown_names() -> None:
    with pytest.raises(InputError, match="digit, gelsight_mini or the path"):
        CameraModel.load("gelsight_maxi")
    with pytest.raises(InputError, match="a DIGIT has QVGA, VGA, got 'HD'"):
        CameraModel.load("digit").mode("HD")
