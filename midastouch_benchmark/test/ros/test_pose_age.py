from __future__ import annotations

import pytest

from midastouch_benchmark.ros.pose_age import followed_rate, pose_age


def test_images_come_as_fast_as_the_machine_can_follow():
    assert followed_rate(0.005) == 30
    assert followed_rate(0.1) == pytest.approx(10 / 3)


@pytest.mark.dds
def test_every_image_finds_its_transform_and_has_a_step():
    steps = []
    result = pose_age(lambda: steps.append(1), images=20)
    age = result["pose_age_ms"]
    # a pose is found once the transform after the image has come
    assert 0 < age["p50"] <= age["p95"] <= age["max"]
    assert 0 < result["pose_age_hz"] <= 30
    assert len(steps) >= 20
