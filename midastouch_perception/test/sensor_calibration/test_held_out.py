import dataclasses

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.calibration import standard_colours
from midastouch_perception.sensor_calibration.held_out import require_upright
from midastouch_perception.sensor_calibration.response import height_slopes
from midastouch_perception.sensor_model import SensorModel


def test_only_a_digit_is_refused_for_colours_that_answer_the_other_way_round():
    digit = SensorModel.load("digit_real").for_maps
    penetration = ball_penetration(ball_centre(60, 80, 1.5e-3, 3e-3, digit), 3e-3, digit)
    upright = standard_colours(height_slopes(np.maximum(penetration, 0), digit.pixel_size))
    require_upright([upright], [penetration], digit)
    with pytest.raises(InputError, match="the other way round than on other DIGITs"):
        require_upright([-upright], [penetration], digit)
    require_upright([-upright], [penetration], dataclasses.replace(digit, lamps=""))
