from __future__ import annotations

import pytest

from midastouch_benchmark.ros.pose_age import pose_age

pytestmark = pytest.mark.dds


def test_every_image_finds_its_transform_and_is_followed_by_a_step():
    steps = []
    result = pose_age(lambda: steps.append(1), images=20)
    age = result["pose_age_ms"]
    # a pose is found once the transform after the image has come
    assert 0 < age["p50"] <= age["p95"] <= age["max"]
    assert len(steps) >= 20
