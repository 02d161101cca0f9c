import numpy as np
import pytest

from midastouch_tools.export.statistics import RowStatistics


def test_statistics_are_those_of_the_whole():
    rng = np.random.default_rng(0)
    rows = [{"pose": rng.normal(3, 2, 4), "seen": rng.integers(0, 256, (5, 4, 3), np.uint8)} for _ in range(50)]
    statistics = RowStatistics({"seen"})
    for row in rows:
        statistics.add(row)
    found = statistics.summary()
    poses = np.stack([row["pose"] for row in rows])
    pixels = np.stack([row["seen"] for row in rows]).reshape(-1, 3) / 255
    for name, values in (("pose", poses), ("seen", pixels)):
        assert found[name]["count"] == [50]
        for key in ("min", "max", "mean", "std"):
            assert np.ravel(found[name][key]) == pytest.approx(getattr(values, key)(axis=0))
    assert np.shape(found["seen"]["mean"]) == (3, 1, 1)
