import numpy as np
import pytest

from midastouch_benchmark.speed import stages
from midastouch_benchmark.speed.stages import paper_network_times
from midastouch_perception.sensor_model import SensorModel


@pytest.mark.slow
def test_both_networks_are_timed_with_random_weights(monkeypatch, tmp_path):
    monkeypatch.setattr(stages.tempfile, "tempdir", str(tmp_path))
    image = np.random.default_rng(0).integers(0, 255, (320, 240, 3), dtype=np.uint8)
    penetration = np.full((160, 120), 1e-3, np.float32)
    times = paper_network_times([image] * 2, [penetration] * 2, SensorModel.load("digit_tacto"))
    assert times.keys() == {"fcrn_ms", "minkloc3d_ms"}
    # no more than that: on a busy machine waiting BLAS threads count as CPU time
    assert min(times["minkloc3d_ms"]["cpu"], times["fcrn_ms"]["cpu"]) > 1
    assert list(tmp_path.iterdir()) == []
