import numpy as np

from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn.inputs import code_input


def test_depth_and_contact_are_means_of_four_pixels_in_metric_units():
    sensor = SensorModel.load("digit_tacto").for_maps
    maps = np.zeros((2, sensor.height, sensor.width), np.float32)
    maps[1, :2, 2:4] = [[1e-3, 0], [0, 2e-3]]
    out = code_input(maps, sensor)
    assert out.shape == (2, 4, sensor.height // 2, sensor.width // 2)
    np.testing.assert_allclose(out[1, :2, 0, 1], [0.75, 0.5], rtol=1e-6)  # mm; share
    assert np.count_nonzero(out[:, :2]) == 2
    x, y = out[0, 2:]
    assert (np.diff(x, axis=1) > 0).all()
    assert (np.diff(y, axis=0) < 0).all()
    # the places are pixels' on the gel, the same for every map: centimetres about the middle
    np.testing.assert_allclose(x, -x[:, ::-1], atol=1e-6)
    assert 0.5 < x.max() < 2
    assert np.array_equal(out[0, 2:], out[1, 2:])
