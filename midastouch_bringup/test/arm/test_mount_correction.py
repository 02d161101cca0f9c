from pathlib import Path

import numpy as np
import pytest

from midastouch_bringup.arm.mount_correction import correct_mount
from midastouch_bringup.arm.mount_frames import read_mount
from midastouch_common import se3
from midastouch_common.errors import InputError

SHIPPED = Path(__file__).parents[2] / "config" / "frames.yaml"


def gel_of(path):
    """T_tool0_gel (4, 4)."""
    mount = read_mount(path)
    return mount[0][2] @ mount[1][2]


def test_the_gel_is_where_it_was_found_to_be(tmp_path):
    found = se3.exp([2e-3, -1e-3, 5e-4, 0.01, 0.03, -0.02])
    change = correct_mount(SHIPPED, tmp_path / "frames.yaml", found)
    np.testing.assert_allclose(gel_of(tmp_path / "frames.yaml"), gel_of(SHIPPED) @ found, atol=5e-6)
    assert se3.rotation_angle(change[:3, :3]) == pytest.approx(np.linalg.norm([0.01, 0.03, -0.02]))


def test_the_other_frames_and_a_second_correction(tmp_path):
    found, path = se3.exp([1e-3, 0, 0, 0, 0.02, 0]), tmp_path / "frames.yaml"
    correct_mount(SHIPPED, path, found)
    correct_mount(path, path, se3.inverse(found))
    np.testing.assert_allclose(gel_of(path), gel_of(SHIPPED), atol=1e-5)
    for (parent, child, _), shipped in zip(read_mount(path)[1:], read_mount(SHIPPED)[1:], strict=True):
        assert (parent, child) == shipped[:2]


def test_a_file_that_cannot_be_read_leaves_nothing_behind(tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text("hand_eye: {}\n")
    with pytest.raises(InputError, match=r"bad\.yaml"):
        correct_mount(bad, tmp_path / "frames.yaml", np.eye(4))
    assert not (tmp_path / "frames.yaml").exists()
