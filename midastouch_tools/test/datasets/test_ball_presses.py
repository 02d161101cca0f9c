import re

import cv2
import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_tools.datasets.ball_presses import load_ball_presses

HEADER = "frame,center_x_px,center_y_px,radius_px\n"
POSITIONS = [(60, 80), (180, 80), (120, 160), (60, 240), (180, 240)]


def free_image() -> np.ndarray:
    rows, columns = np.mgrid[:320, :240]
    return np.stack([60 + columns // 4, 60 + rows // 5, np.full_like(rows, 90)], axis=-1).astype(np.uint8)


@pytest.fixture
def folder(tmp_path):
    """Five presses, each of them a disc of radius 30 px elsewhere."""
    for i, position in enumerate(POSITIONS):
        image = cv2.circle(free_image(), position, 30, (200, 30, 160), -1)
        cv2.imwrite(str(tmp_path / f"{i:04d}.png"), image[:, :, ::-1])
    return tmp_path


def write_circles(folder, extra=""):
    rows = "".join(f"{i:04d},{x},{y},30\n" for i, (x, y) in enumerate(POSITIONS))
    (folder / "circles.csv").write_text(HEADER + rows + extra)


def test_images_background_and_circles(folder):
    cv2.imwrite(str(folder / "background.png"), free_image()[:, :, ::-1])
    cv2.imwrite(str(folder / "0005.png"), cv2.imread(str(folder / "0000.png")))
    write_circles(folder, "0003,61,241,31\n")
    presses = load_ball_presses(folder)
    assert list(presses.images) == [f"{i:04d}.png" for i in range(5)], "the same image twice is one press"
    np.testing.assert_array_equal(presses.background, free_image())
    assert presses.circles["0001.png"] == (180, 80, 30)
    assert presses.circles["0003.png"] == (61, 241, 31), "who labels again appends"
    some = presses.only(["0002.png"])
    assert list(some.images) == list(some.circles) == ["0002.png"]
    assert some.background is presses.background


@pytest.mark.parametrize("labelled", [True, False])
def test_without_background_it_is_told_from_the_presses(folder, labelled):
    if labelled:
        write_circles(folder)
    presses = load_ball_presses(folder)
    assert (presses.circles is not None) == labelled
    np.testing.assert_allclose(presses.background.astype(int), free_image(), atol=1)


def test_a_place_pressed_in_every_image_has_no_background(folder):
    (folder / "circles.csv").write_text(HEADER + "".join(f"{i:04d},120,160,90\n" for i in range(5)))
    with pytest.raises(InputError, match=r"pressed in every image.*background\.png"):
        load_ball_presses(folder)


def test_folders_without_presses(tmp_path):
    with pytest.raises(InputError, match=r"none.*folder"):
        load_ball_presses(tmp_path / "none")
    cv2.imwrite(str(tmp_path / "background.png"), free_image())
    with pytest.raises(InputError, match=re.escape(str(tmp_path))):
        load_ball_presses(tmp_path)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("frame,x,y,r\n0000,1,2,3\n", "center_x_px, center_y_px, radius_px"),
        ("", "frame"),
        (HEADER + "0000,60,80,thirty\n", "line 2"),
        (HEADER + "0000,60,80\n", "line 2"),
        (HEADER + "0000,60,80,-3\n", "line 2"),
        (HEADER + "0000,nan,80,30\n", "line 2"),
        (HEADER + "0000,60,80,1\n", "line 2.*radius from 3 to 320 px"),
        (HEADER + "0000,60,80,1e308\n", "line 2"),
        ("center_x_px,center_y_px,radius_px,frame\n60,80,30\n", "line 2"),
        (HEADER + "0009,60,80,30\n", "line 2.*0009"),
        (HEADER + "0000,60,80,30\n", "0001.png"),
        (HEADER + "".join(f"000{i},300,80,30\n" for i in range(5)), "0000.png"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "UTF-8"),
        (HEADER.encode("utf-16"), "UTF-8"),
        ((HEADER + "é").encode("latin-1"), "UTF-8"),
        pytest.param(b"a" * 200_000, "UTF-8", id="endless field"),
    ],
)
def test_labels_that_do_not_fit_or_are_no_table(folder, content, problem):
    (folder / "circles.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=rf"circles\.csv.*{problem}"):
        load_ball_presses(folder)


def test_labels_out_of_a_spreadsheet(folder):
    write_circles(folder)
    file = folder / "circles.csv"
    file.write_text(file.read_text(), encoding="utf-8-sig")
    assert load_ball_presses(folder).circles["0001.png"] == (180, 80, 30)


def test_labels_in_a_folder_are_not_passed_over(folder):
    (folder / "circles.csv").mkdir()
    with pytest.raises(InputError, match=r"circles\.csv"):
        load_ball_presses(folder)


def test_jpeg_by_any_name(folder):
    image = next(path for path in folder.iterdir() if path.name != "background.png" and path.suffix == ".png")
    cv2.imwrite(str(folder / "another.jpeg"), 255 - cv2.imread(str(image)))
    assert "another.jpeg" in load_ball_presses(folder).images


@pytest.mark.parametrize("name", ["background.jpg", "Background.PNG"])
def test_a_misnamed_no_contact_image_is_not_taken_for_a_press(folder, name):
    cv2.imwrite(str(folder / name), free_image()[:, :, ::-1])
    with pytest.raises(InputError, match=r"save the no-contact image as background\.png"):
        load_ball_presses(folder)
