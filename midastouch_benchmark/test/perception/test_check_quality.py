import numpy as np
import pytest

from midastouch_benchmark.perception import check_quality
from midastouch_benchmark.perception.check_quality import (
    FACTORS,
    FAULTS,
    TOUCHES,
    ImaginarySensor,
    diameter_checks,
    imaginary_sensors,
    layout_quality,
    real_checks,
    roc_area,
    wire,
)
from midastouch_perception.sensor_calibration.network_checks import RADIUS_RATIO
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.randomisation import RandomisationRange
from midastouch_simulation.simulated_digit import PressedSensor
from midastouch_tools.datasets.ball_presses import BallPresses


class SlopeTdn:
    """Feels the penetration map that the fake images code as brightness: 10 um a grey level of their mean change."""

    network_id = "fake"

    def __init__(self):
        self.sensor = SensorModel.load("digit_tacto").scaled(0.5)

    def change(self, image, background):
        return image.astype(np.float32) - background

    def shown(self, change):
        return change

    difference = change

    def predict(self, image, background, difference=None):
        change = self.difference(image, background) if difference is None else difference
        return np.where(change[..., 2] > 4, change[..., 2], 0) * np.float32(2e-5)

    def depth(self, difference, penetration):
        return float(penetration.max())


def sensor_at(level: int) -> ImaginarySensor:
    """A grey gel, not quite even, so that any change of its brightness changes its image; a touch lights blue by its
    depth, red and green by its slopes."""
    rows, columns = np.mgrid[:160, :120]
    gel = np.repeat((level + columns // 2)[..., None], 3, axis=2)
    background = gel.astype(np.uint8)
    touches = []
    for k in range(TOUCHES):
        depth = np.maximum(0, 60 - ((rows - 60 - 5 * k) ** 2 + (columns - 60) ** 2) / 12)
        down, right = np.gradient(depth)
        touches.append(np.clip(gel + np.stack([8 * right, 8 * down, depth * 0.2], axis=-1), 0, 255))
    touches = np.array(touches, np.uint8)
    light = {"wire": (touches, np.full(TOUCHES, 0.3e-3)), "eyebolt": (background[None], np.array([0.06e-3]))}
    return ImaginarySensor(background, touches, light, background.copy())


@pytest.fixture(scope="module")
def quality():
    sensors = [(sensor_at(level), sensor_at(level + 40)) for level in (100, 130)]
    return check_quality.check_quality(SlopeTdn(), sensors)


def test_fit_check_alarms(quality):
    fit = quality["fit_check"]
    assert set(fit) == {"right", *FAULTS}
    assert fit["right"]["alarms"] == 0
    assert fit["right"]["auc_quietest_tenth"] == 0.5
    assert fit["another sensor's background"]["alarms"] == 1
    assert fit["another sensor's background"]["quietest_tenth"] > 30
    assert fit["another sensor's background"]["auc_quietest_tenth"] == 1
    assert fit["15 % brighter than the background"]["alarms"] == 1


def test_contacts_are_counted_by_depth(quality):
    contact = quality["contact"]
    deep = next(c for c in contact["missed"]["wire"] if c["from_mm"] == pytest.approx(0.2))
    assert (deep["touches"], deep["missed"]) == (2 * TOUCHES, 0)
    faint = contact["missed"]["eyebolt"][0]
    assert (faint["touches"], faint["missed"]) == (2, 1)
    false = {c["brighter"]: c["false_contacts"] for c in contact["false"]}
    assert false[0.0] == 0
    assert false[0.1] == 1
    assert contact["false_while_warming"] < 0.1


def test_captures(quality):
    capture = quality["capture"]
    assert capture["no contact refused"] == 0
    assert capture["another sensor's no contact refused"] == 0


def test_imaginary_sensors_differ_and_repeat():
    sensor = SensorModel.load("digit_tacto").scaled(0.25)
    backgrounds = np.random.default_rng(0).integers(60, 180, (3, 80, 60, 3)).astype(np.uint8)

    def draw():
        rng = np.random.default_rng(1)
        return list(imaginary_sensors(2, sensor, backgrounds, RandomisationRange(), rng))

    first, second = draw()
    assert first.touches.shape == (TOUCHES, 80, 60, 3)
    assert first.touches.dtype == first.background.dtype == first.free.dtype == np.uint8
    assert set(first.light) == {"eyebolt", "wire"}
    depths = np.concatenate([d for _, d in (*first.light.values(), *second.light.values())])
    assert depths.min() > 0
    assert depths.max() < 2.5e-3
    assert (first.background != second.background).any()
    np.testing.assert_array_equal(first.touches, draw()[0].touches)


def test_a_wire_is_thin():
    assert sorted(np.ptp(wire().vertices, axis=0).round(4)) == pytest.approx([0.002, 0.002, 0.04], abs=2e-4)


def test_roc_area():
    assert roc_area(np.array([2.0, 3]), np.array([0.0, 1, np.nan])) == 1
    assert roc_area(np.array([1.0]), np.array([0.0, 1, 2])) == 0.5
    assert np.isnan(roc_area(np.array([]), np.array([1.0])))


def test_layouts_of_real_sensors(shared):
    """Of the 24 real no-contact images few are refused as they are, and nearly all when they are wrong."""
    from midastouch_simulation.training.setting import load_backgrounds

    images = np.concatenate(load_backgrounds(shared / "data/digit_backgrounds", 80, 60))
    refused, named = layout_quality(images)
    assert refused.pop("right") < 0.1
    assert refused.pop("mirrored top to bottom") > 0.6  # blue alone tells it
    # some sensors are lit as others are that stand on their head with red and blue swapped
    assert refused.pop("mirrored top to bottom and with red and blue swapped") > 0.5
    assert min(refused.values()) > 0.9
    assert min(named.values()) >= 0.5
    assert np.mean(list(named.values())) > 0.75


@pytest.fixture(scope="module")
def real():
    return SensorModel.load("digit_real")


@pytest.mark.slow
def test_alarms_are_counted_with_right_and_touched_backgrounds(real):
    rng = np.random.default_rng(7)
    digit = PressedSensor(real, no_contact_image(real, rng)[None], 3e-3, rng)
    presses = BallPresses(digit.presses(8), digit.background, None)
    counted = real_checks(load_tdn("fast", real), presses, rng)
    assert counted["trials"] == 16
    assert counted["right"] <= 0.1
    assert counted["touched"] >= 0.7


def test_doubts_are_counted_by_factor(real, monkeypatch):
    truth = iter(np.random.default_rng(0).uniform(0.98, 1.02, 3) * RADIUS_RATIO * 3e-3)
    monkeypatch.setattr(check_quality, "measured_radius", lambda *_: next(truth))
    monkeypatch.setattr(check_quality, "RADII", (3e-3, 3e-3))
    rng = np.random.default_rng(0)
    counted = diameter_checks(real, no_contact_image(real, rng)[None], 3, rng)
    assert counted["felt_over_true"] == pytest.approx(RADIUS_RATIO, rel=0.02)
    assert counted["spread"] < 0.03
    given = {each["factor"]: each for each in counted["given"]}
    assert set(given) == set(FACTORS)
    assert given[1.0] == {"factor": 1.0, "doubted": 0}
    assert given[2.0]["doubted"] == given[0.5]["doubted"] == 1
