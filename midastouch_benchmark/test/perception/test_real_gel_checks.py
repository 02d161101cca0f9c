"""Real gel, simulated: contacts that are none, touches that are missed, depth that is commanded."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from midastouch_benchmark.perception import real_gel_checks
from midastouch_benchmark.perception.check_quality import as_bytes
from midastouch_benchmark.perception.real_gel_checks import (
    measured_readings,
    mini_reading,
    missed_touches,
    slow_light,
    texture_calibrations,
)
from midastouch_benchmark.perception.soft_gel import CommandedPresses, SoftSensor
from midastouch_perception import pipeline
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.measured_optics import MeasuredOptics
from midastouch_tools.datasets.ball_presses import BallPresses


@pytest.fixture(scope="module")
def readings():
    return measured_readings("fast", np.random.default_rng(0))


def test_half_of_the_readings_are_calibrated(readings):
    assert [each.tdn.calibration_in_use is not None for each in readings] == [False, True] * 2
    assert mini_reading("fast").tdn.calibration_in_use is not None


def test_light_that_is_taken_for_a_contact_is_counted(readings, monkeypatch):
    monkeypatch.setattr(real_gel_checks, "SLOW_LIGHT", (0.05, 0.8))
    monkeypatch.setattr(real_gel_checks, "RECORDS", (2,))
    rows = slow_light(readings[::2], 3, np.random.default_rng(0))
    assert [(row["images"], row["change"], row["frames"]) for row in rows] == [(2, 0.05, 12), (2, 0.8, 12)]
    assert [row["false_contacts"] for row in rows] == [0, 0]
    monkeypatch.setattr(pipeline, "explained_fraction", lambda *_, **__: 1.0)
    assert slow_light(readings[::2], 3, np.random.default_rng(0))[1]["false_contacts"] > 0.2


def test_touches_are_missed_the_lighter_they_are(readings):
    missed = missed_touches(readings[:1], 20, np.random.default_rng(0))
    assert set(missed) == {"eyebolt; DIGIT", "wire; DIGIT"}
    for bins in missed.values():
        assert sum(each["touches"] for each in bins) <= 20
        assert bins[-1]["missed"] == 0


@pytest.mark.parametrize("calibrated", [False, True])
def test_depth_is_that_below_the_untouched_gel_once_calibrated(calibrated):
    """Balls and flat faces pressed into an elastic layer of 3 mm; without a calibration it is the deepest penetration,
    which is less."""
    sensor, rng = SensorModel.load("digit_real"), np.random.default_rng(0)
    presses = CommandedPresses(sensor, 6, np.random.default_rng(1))
    soft = SoftSensor(MeasuredOptics.load("vocdex"), sensor, 3e-3, rng if calibrated else None)
    rows = list(presses.seen_by(soft))
    off = {kind: np.median([abs(r["depth_mm"] - r["commanded_mm"]) for r in rows if r["press"] == kind])
           for kind in ("ball", "flat face")}  # fmt: skip
    if calibrated:
        assert off["ball"] < 0.12
        assert off["flat face"] < 0.15
    else:
        assert min(off.values()) > 0.12


def test_more_presses_recognise_a_gel_more_surely():
    """Sums of many textures do not wrap."""
    rng, sensor = np.random.default_rng(0), SensorModel.load("digit_real")
    grain = cv2.GaussianBlur(rng.standard_normal((320, 240, 3)), (0, 0), 2.0)
    background = np.clip(120 + 60 * grain, 0, 255)
    sigmas = []
    for count in (5, 80):
        images = {f"{k}.png": as_bytes(background + rng.normal(0, 30, background.shape)) for k in range(count)}
        presses = BallPresses(images, as_bytes(background), None)
        (calibration, _), _ = texture_calibrations(presses, [np.zeros((160, 120))] * count, sensor)
        sigmas.append(calibration.texture_sigmas)
    assert sigmas[1] > sigmas[0] > 0
