"""What is written is what is read, and nothing is left of a failure."""

import pickle

import cv2
import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.datasets import load_sequence, write_sequence

SENSOR = SensorModel.load("digit_tacto")
GREY = np.full((320, 240, 3), 90, np.uint8)
FLAT = np.zeros((320, 240), np.float32)


def write(path, frames, n_poses=2, **changes):
    poses = se3.exp(np.zeros((n_poses, 6)))
    arguments = {"background": GREY, "object_name": "box", "sensor": SENSOR, "noise": {"sig_t": 0, "sig_r": 0}}
    write_sequence(path, frames, poses, poses, **(arguments | changes))


def test_poses_images_and_truth_survive(simulated_sequence):
    sequence = simulated_sequence(n=12)
    assert (sequence.n_frames, sequence.layout, sequence.object_name) == (12, "simulated", "test_object")
    assert sequence.name == "test_object/00"
    assert sequence.ground_truth_frames == tuple(range(12))
    np.testing.assert_array_equal(sequence.background, GREY)
    truth = sequence.penetration_truth(11)
    rows, columns = np.mgrid[:320, :240]
    expected = np.maximum(0, 1e-3 * (1 - (np.hypot(rows - 160, columns - 170) / 40) ** 2))
    np.testing.assert_allclose(truth, expected, atol=0.51e-6)
    assert truth.dtype == np.float32
    # frame 11 after frame 2: order of numbers, not of names
    assert np.abs(sequence.image(11).astype(int)[..., 2].mean() - (40 + 17)) < 2
    assert se3.rotation_angle(sequence.poses_measured[:, :3, :3]).shape == (12,)
    assert not np.array_equal(sequence.poses_true, sequence.poses_measured)


def test_camera_poses_lie_22_mm_up_the_gel_normal(simulated_sequence):
    sequence = simulated_sequence()
    stored = pickle.loads((sequence.path / "tactile_data.pkl").read_bytes())
    gel_from_camera = se3.inverse(sequence.poses_true) @ se3.from_xyzquat(stored["camposes"])
    expected = np.repeat(se3.translation([0, 0, 0.022])[None], 5, axis=0)
    np.testing.assert_allclose(gel_from_camera, expected, atol=1e-12)
    assert stored["mNoise"] == {"sig_t": 5e-4, "sig_r": 1.0}


def test_height_maps_hold_the_dome_and_masks_the_contact(simulated_sequence):
    path = simulated_sequence().path
    heights = cv2.imread(str(path / "gt_heightmaps" / "0.jpg"), cv2.IMREAD_GRAYSCALE).astype(int)
    assert abs(heights[2, 2] - 96) <= 3  # the bare dome in the image's corner
    assert abs(heights[160, 60] - 33 - (SENSOR.gel_distance - SENSOR.gel_depth[160, 60]) / 3e-5) <= 3
    mask = cv2.imread(str(path / "gt_contactmasks" / "0.jpg"), cv2.IMREAD_GRAYSCALE) > 127
    assert mask[160, 60]
    assert not mask[10, 200]


def test_a_failure_leaves_nothing_behind(tmp_path):
    def frames():
        yield GREY, FLAT
        raise RuntimeError("renderer gave up")

    with pytest.raises(RuntimeError, match="gave up"):
        write(tmp_path / "00", frames())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([(GREY, FLAT)], "1 frames.*2 true"),
        ([], "0 frames"),
        ([(GREY[:, :100], FLAT)] * 2, "320 x 240"),
        ([(GREY, FLAT[:50])] * 2, "320 x 240"),
    ],
)
def test_frames_that_do_not_fit_are_refused(tmp_path, frames, message):
    with pytest.raises(InputError, match=f"00.*{message}"):
        write(tmp_path / "00", frames)
    assert list(tmp_path.iterdir()) == []


def test_a_sequence_is_replaced_but_no_other_folder(tmp_path, simulated_sequence):
    old = simulated_sequence(n=3)
    write(old.path, [(GREY, FLAT)] * 2)
    assert load_sequence(old.path).n_frames == 2
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="choose another folder"):
        write(tmp_path, [(GREY, FLAT)] * 2)
    with pytest.raises(InputError, match="choose another folder"):
        write(tmp_path / "thesis.txt", [(GREY, FLAT)] * 2)
    assert (tmp_path / "thesis.txt").read_text() == "precious"


def test_an_unwritable_disk_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(cv2, "imwrite", lambda *_: False)
    with pytest.raises(OSError, match="disk full"):
        write(tmp_path / "00", [(GREY, FLAT)] * 2)
    assert list(tmp_path.iterdir()) == []
