import pytest

from digit_driver.leds import packed, scaled_levels


@pytest.mark.parametrize(
    ("rgb", "value"), [((15, 15, 15), 0xFFF), ((15, 0, 0), 0xF00), ((0, 10, 0), 0x0A0), ((1, 2, 3), 0x123)]
)
def test_packing_is_four_bits_each_red_highest(rgb, value) -> None:
    assert packed(rgb) == value


def test_intensity_scales_the_colour() -> None:
    assert scaled_levels(15, [15, 7, 0]) == (15, 7, 0)
    assert scaled_levels(0, [15, 7, 0]) == (0, 0, 0)
    assert scaled_levels(7, [15, 15, 0]) == (7, 7, 0)
