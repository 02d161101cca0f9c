import pytest

from midastouch_bringup.view.scene import guidance_text, region_box
from midastouch_perception.sensor_calibration.collector import REGIONS


def test_step_progress_and_what_was_thrown_away_are_told():
    values = {"taken": "2", "wanted": "5", "last_press": "not taken: two contacts", "thrown_away": "7"}
    values |= {"thrown_away_1": "cut off at the edge of the view", "thrown_away_2": "two contacts", "region": "centre"}
    text = guidance_text("2 of 5: press the ball at the centre", values)
    assert text.startswith("# 2 of 5: press the ball at the centre")
    assert "\u25cf\u25cf\u25cb\u25cb\u25cb" in text
    assert "Last press: not taken: two contacts" in text
    assert "Thrown away: 7" in text
    assert "- cut off at the edge of the view\n- two contacts" in text


def test_at_the_start_there_is_the_step_alone():
    text = guidance_text("0 of 5: press the ball at the top left", {"taken": "0", "wanted": "5", "last_press": ""})
    assert "Last" not in text
    assert "Thrown" not in text


def test_regions_cover_the_image():
    boxes = [region_box(region) for region in REGIONS]
    assert boxes[0] == ((0, 0), (80, pytest.approx(320 / 3)))
    assert boxes[REGIONS.index("middle right")][0] == (160, pytest.approx(320 / 3))
    assert sum(width * height for _, (width, height) in boxes) == pytest.approx(240 * 320)
