"""Presses that grow and shrink, on a network that is right, and on one that feels nothing."""

import numpy as np
import pytest

from midastouch_benchmark.perception import ramps
from midastouch_benchmark.tables import checks
from midastouch_perception.contact import Contact, ContactState


def contact(depth):
    """One of a depth [m], free if it is 0."""
    return Contact(
        np.zeros((160, 120), np.float32), 1e-3 * depth, depth, ContactState.CONTACT if depth else ContactState.FREE
    )


@pytest.mark.slow
def test_each_shape_is_pressed_and_felt_or_not(monkeypatch):
    model = ramps.pressed_sensors("fast")[0]
    rows = list(ramps.measured_ramps(model, 1, 0))
    assert [row["shape"] for row in rows] == list(ramps.shapes())
    assert all(row["images"] == 46 and row["free_images"] == 10 for row in rows)
    face, _, ball, _ = rows
    assert face["saturated"] > 20 > ball["saturated"] == 0
    assert sum(row["missed"] + row["false"] for row in rows) <= 1
    assert list(checks.ramps({"ramps": rows})["images"]) == ["46"] * 4

    # one that feels only free gel
    monkeypatch.setattr(ramps.DepthStage, "process", lambda *_: contact(0.0))
    blind = next(ramps.measured_ramps(model, 2, 0))
    assert blind["missed"] == blind["images"] == 46 + 92
    assert (blind["presses_missed"], blind["false"], blind["presses_falling"]) == (2, 0, 0)


def test_a_reading_that_falls_is_counted_once_for_each_press(monkeypatch):
    """The second by 0.3 mm, twice; the first by 0.02 mm, which is noise."""
    up, up_twice = np.linspace(0.2e-3, 2e-3, 23), np.linspace(0.2e-3, 2e-3, 46)
    up[10] = up[9] - 0.02e-3
    up_twice[[10, 20]] = up_twice[[9, 19]] - 0.3e-3
    deep = iter([0.0] * 5 + [*up, *up[::-1]] + [0.0] * 10 + [*up_twice, *up_twice[::-1]] + [0.0] * 5)
    monkeypatch.setattr(ramps.DepthStage, "process", lambda *_: contact(next(deep)))
    row = next(ramps.measured_ramps(ramps.pressed_sensors("fast")[1], 2, 0))
    assert (row["presses_falling"], row["missed"]) == (1, 0)
    assert row["most_fall_mm"] == pytest.approx(0.3)
