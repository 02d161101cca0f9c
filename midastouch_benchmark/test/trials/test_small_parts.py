import numpy as np
import pytest

from midastouch_benchmark.trials.small_parts import small_parts
from midastouch_perception.symmetry.search import near_symmetry

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
    assert near_symmetry(parts["hex_nut"])[0].describe() == "12 poses alike"
    assert near_symmetry(parts["hex_key"])[0].trivial


def test_they_are_made_once(tmp_path):
    first = small_parts(tmp_path)
    times = [mesh.path.stat().st_mtime_ns for mesh in first]
    again = small_parts(tmp_path)
    assert [mesh.path.stat().st_mtime_ns for mesh in again] == times
    assert [mesh.sha256 for mesh in again] == [mesh.sha256 for mesh in first]
