import pytest

from digit_driver.leds import packed, scaled_levels
from midastouch_common.errors import InputError


@pytest.mark.parametrize(
    ("rgb", "value"), [((15, 15, 15), 0xFFF), ((15, 0, 0), 0xF00), ((0, 10, 0), 0x0A0), ((1, 2, 3), 0x123)]
)
def test_packing_is_four_bits_each_red_highest(rgb, value) -> None:
    assert packed(rgb) == value


def test_intensity_scales_the_colour() -> None:
    assert scaled_levels(15, [15, 7, 0]) == (15, 7, 0)
    assert scaled_levels(0, [15, 7, 0]) == (0, 0, 0)
    assert scaled_levels(7, [15, 15, 0]) == (7, 7, 0)


@pytest.mark.parametrize(("intensity", "rgb"), [(16, [15] * 3), (-1, [15] * 3), (15, [15, 15]), (15, [0, 0, 16])])
def test_impossible_levels_are_refused(intensity, rgb) -> None:
    with pytest.raises(InputError, match=r"0\.\.\.15"):
        scaled_levels(intensity, rgb)
