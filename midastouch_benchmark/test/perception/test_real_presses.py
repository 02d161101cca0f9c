"""Depth is read on real sensors that the networks have never seen: some of the development presses."""

import pytest

from midastouch_benchmark.perception.press_quality import measure_presses
from midastouch_bringup.datasets.ball_presses import load_ball_presses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn


@pytest.mark.parametrize(
    ("folder", "radius", "scale"),
    [("sphere_presses_d20641", 4.4e-3, 18680.0), ("sphere_presses_vocdex", 3e-3, 18500.0)],
)
def test_a_ball_feels_as_one_of_about_its_size(shared, folder, radius, scale):
    presses = load_ball_presses(shared / "data/digit_real" / folder)
    some = presses.only(sorted(presses.images)[::3])
    summary = measure_presses(load_tdn("fast", SensorModel.load("digit_real").at_scale(scale)), some, radius)[1]
    assert summary["found_share"] == summary["bulges_share"] == 1
    assert 0.5 < summary["peak_ratio"] < 1.4
    assert 0.65e3 * radius < summary["felt_radius_mm"] < 1.6e3 * radius
    assert summary["iou"] > 0.75
    assert summary["outside_share"] < 0.05
