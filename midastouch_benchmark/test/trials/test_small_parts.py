import numpy as np
import pytest

from midastouch_benchmark.trials.small_parts import small_parts
from midastouch_perception.codebook import codebook_poses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import object_symmetry

GEL = 0.03  # m, the longer side


@pytest.fixture(scope="module")
def parts(tmp_path_factory) -> dict:
    return {mesh.name: mesh for mesh in small_parts(tmp_path_factory.mktemp("parts"))}


def test_parts_are_smaller_than_the_gel(parts):
    assert len(parts) == 8
    for mesh in parts.values():
        assert np.ptp(mesh.bounds, axis=0).max() < GEL


@pytest.mark.slow
def test_symmetric_poses_of_a_nut_are_known(parts):
    sensor = SensorModel.load("digit_tacto")
    for name, words in (("hex_nut", "12 poses alike"), ("hex_key", "none")):
        poses = codebook_poses(parts[name], 4000, sensor, np.random.default_rng(0))
        assert object_symmetry(parts[name], sensor, poses).exact.describe() == words


def test_they_are_made_once(tmp_path):
    first = small_parts(tmp_path)
    times = [mesh.path.stat().st_mtime_ns for mesh in first]
    again = small_parts(tmp_path)
    assert [mesh.path.stat().st_mtime_ns for mesh in again] == times
    assert [mesh.sha256 for mesh in again] == [mesh.sha256 for mesh in first]
