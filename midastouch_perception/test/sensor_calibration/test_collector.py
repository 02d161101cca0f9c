import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.collector import PressCollector

DIAMETER = 6e-3


@pytest.fixture
def collector(digit, real):
    return PressCollector(digit.background, DIAMETER, real, wanted=2)


def held(collector, image, frames: int = 6) -> list[str]:
    """What is said of an image that stays."""
    return [said for _ in range(frames) if (said := collector.observe(image))]


def test_presses_are_taken_once_each_until_there_are_enough(collector, digit):
    assert collector.next_step == "0 of 2: press the ball at the top left"
    assert held(collector, digit.background) == []
    first = digit.image([(60, 60, 1.5e-3)])
    assert held(collector, first, 12) == ["taken"]
    assert collector.next_step == "1 of 2: lift the ball"
    assert not collector.done
    held(collector, digit.background)
    assert collector.next_step == "1 of 2: press the ball at the top centre"
    assert held(collector, digit.image([(180, 250, 1.5e-3)])) == ["taken"]
    assert collector.done
    assert list(collector.images) == ["press_00.png", "press_01.png"]
    np.testing.assert_array_equal(collector.images["press_00.png"], first)


def test_a_ball_that_moves_is_waited_for(collector, digit):
    moving = [digit.image([(60 + 8 * i, 100, 1.5e-3)]) for i in range(10)]
    assert [collector.observe(image) for image in moving] == [""] * 10
    assert held(collector, moving[-1]) == ["taken"]


def test_lamps_that_have_warmed_since_are_no_ball(collector, digit):
    warmer = np.linspace(0.94, 1.06, 320)[:, None, None] * [1.03, 1.0, 0.97]

    def now(image):
        return np.clip(image * warmer, 0, 255).astype(np.uint8)

    assert held(collector, now(digit.background)) == []
    assert held(collector, now(digit.image([(120, 160, 1.5e-3)]))) == ["taken"]
    held(collector, now(digit.background))
    assert collector.next_step == "1 of 2: press the ball at the top left"


def test_a_lasting_change_may_be_the_no_contact_image_s_fault(collector, digit):
    pressed = digit.image([(120, 160, 1.5e-3)])
    held(collector, pressed, 60)
    assert collector.next_step == "1 of 2: lift the ball"
    held(collector, pressed, 300)
    assert "capture the no-contact image" in collector.next_step
    held(collector, digit.background)
    assert "press" in collector.next_step


def test_the_same_place_and_what_is_no_press_are_not_taken(collector, digit):
    held(collector, digit.image([(120, 160, 1.5e-3)]))
    held(collector, digit.background)
    (said,) = held(collector, digit.image([(122, 161, 1.4e-3)]))
    assert "already" in said
    held(collector, digit.background)
    (said,) = held(collector, digit.image([(60, 70, 1.5e-3), (180, 260, 1.5e-3)]))
    assert said == "not taken: two contacts"
    assert len(collector.images) == 1
    assert ["already" in collector.refusals[0], collector.refusals[1:]] == [True, ["two contacts"]]
    with pytest.raises(InputError, match="tactile image"):
        collector.observe(digit.background[::2])
