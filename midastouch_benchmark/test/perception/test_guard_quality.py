"""Frames shown to the guards are what they are called, and are counted."""

import numpy as np
import pytest

from midastouch_benchmark.perception.guard_quality import VISIBLE, guard_rows, judged_slide, slide_frames, torn_frame
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import no_contact_image


@pytest.mark.parametrize("axis", [0, 1])
def test_a_torn_frame_has_lines_of_both_and_tells_how_far_they_differ(axis):
    above, below = (np.full((320, 240, 3), level, np.uint8) for level in (100, 110))
    torn, difference = torn_frame(above, below, 50, axis)
    assert difference == pytest.approx(10)
    lines = torn.mean(axis=(1 - axis, 2))
    assert set(lines[:50]) == {100}
    assert set(lines[50:]) == {110}


@pytest.mark.slow
def test_a_slide_is_shown_whole_torn_rolled_and_turned():
    sensor, rng = SensorModel.load("digit_real"), np.random.default_rng(3)
    mesh = ObjectMesh.load(bundled_objects()["handle_tool"])
    frames = slide_frames(mesh, sensor, no_contact_image(sensor, rng), 1.5e-3, 3)
    verdicts = [("digit_real", 0, *verdict) for verdict in judged_slide(frames, rng)]
    rows = {row["what"]: row for row in guard_rows(verdicts)}
    assert rows["good, against the frames before"]["frames"] == len(frames)
    assert rows["good, against the frames before"]["refused"] == 0
    assert rows["good, against the no-contact image"]["refused"] == 0
    assert rows["torn"]["frames"] == len(frames) - 3
    seen = rows[f"torn, the parts differ by {VISIBLE:g} grey levels"]
    assert seen["share"] > 0.9
    low, high = seen["interval"]
    assert low <= seen["share"] <= high


def test_verdicts_are_counted_for_each_sensor_and_kind():
    verdicts = [("a", slide, "torn", refused) for slide in range(3) for refused in (True, False)]
    verdicts.append(("b", 0, "torn", True))
    first, second = guard_rows(verdicts)
    assert (first["sensor"], first["slides"], first["frames"], first["refused"], first["share"]) == ("a", 3, 6, 3, 0.5)
    assert (second["sensor"], second["refused"], second["share"]) == ("b", 1, 1.0)
