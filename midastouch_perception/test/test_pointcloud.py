import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_common.errors import InputError
from midastouch_perception.contact import in_steps
from midastouch_perception.pointcloud import cloud_from_penetration, penetration_from_cloud
from midastouch_perception.sensor_model import SensorModel


@pytest.mark.parametrize("name", ["digit_tacto", "digit_real"])
@given(seed=st.integers(0, 2**31), fraction=st.floats(0, 1))
@settings(max_examples=15, deadline=None)
def test_map_survives_the_cloud(name, seed, fraction):
    sensor = SensorModel.load(name).scaled(0.5)
    rng = np.random.default_rng(seed)
    penetration = in_steps(rng.uniform(1e-5, 3e-3, (160, 120)).astype(np.float32))
    mask = rng.random((160, 120)) < fraction
    cloud = cloud_from_penetration(penetration, mask, sensor)
    assert cloud.shape == (mask.sum(), 3)
    np.testing.assert_array_equal(penetration_from_cloud(cloud, sensor), np.where(mask, penetration, np.float32(0)))


def test_points_lie_in_the_gel_frame(sensor):
    """A flat 1 mm press: the apex point is 1 mm towards the camera, y is up in the image."""
    penetration = np.zeros((320, 240), np.float32)
    penetration[160, 120] = penetration[20, 120] = 1e-3
    top, apex = cloud_from_penetration(penetration, penetration > 0, sensor)
    np.testing.assert_allclose(apex, [0, 0, 1e-3], atol=5e-5)
    assert top[1] > 0.008


@pytest.mark.parametrize(
    ("made", "read"),
    [("digit_real", "digit_tacto"), ("gelsight_mini", "digit_tacto"), ("digit_tacto", "gelsight_mini")],
)
def test_the_cloud_of_another_sensor_is_refused(made, read):
    made, read = (SensorModel.load(name).for_maps for name in (made, read))
    penetration = np.zeros((160, 120), np.float32)
    penetration[70:90, 50:70] = 3e-4
    with pytest.raises(InputError, match=f"not at pixels of {read.name}; start tdn, tcn and particle_filter with"):
        penetration_from_cloud(cloud_from_penetration(penetration, penetration > 0, made), read)


@pytest.mark.parametrize("cloud", [np.empty((0, 3)), np.array([[0.1, 0, 0], [0, 0, 0.03]])])
def test_clouds_without_a_point_in_view_are_no_contact(sensor, cloud):
    assert not penetration_from_cloud(cloud, sensor).any()


@pytest.mark.parametrize(("cloud", "said"), [(np.zeros((4, 2)), "need"), (np.array([[0, 0, np.nan]]), "non-finite")])
def test_unusable_clouds_are_refused(sensor, cloud, said):
    with pytest.raises(InputError, match=said):
        penetration_from_cloud(cloud, sensor)
