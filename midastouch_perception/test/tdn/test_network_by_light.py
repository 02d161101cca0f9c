from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn


def test_the_sensor_s_light_chooses_the_network():
    assert load_tdn("fast").network_id.startswith("tdn_fast-")
    assert load_tdn("fast", SensorModel.load("digit_real")).network_id.startswith("tdn_fast_relative-")
