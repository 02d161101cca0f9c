"""Trials in the layout of the published dataset: what its card and its authors' readers say of every file."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sequences import write_video

from midastouch_benchmark.trials.setup import untouched_of
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.datasets import load_sequence

FRAMES = 6


def tactile_image(i: int) -> np.ndarray:
    """Landscape (240, 320, 3) BGR: a red mark at the right border, a blue one at the bottom, brighter every frame."""
    image = np.full((240, 320, 3), 60 + 10 * i, np.uint8)
    image[80:160, 280:] = (0, 0, 250)
    image[200:, 100:220] = (250, 0, 0)
    return image


@pytest.fixture
def trial(tmp_path):
    """`avocado0`: a translation along every axis of the sensor, then a turn about its z."""
    folder = tmp_path / "TactileTracking" / "avocado0"
    folder.mkdir(parents=True)
    write_video(folder / "gelsight.avi", [tactile_image(i) for i in range(FRAMES)])
    write_video(folder / "webcam.avi", [np.zeros((120, 160, 3), np.uint8)] * FRAMES)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[1:, 0, 3] = 1e-3
    poses[2:, 1, 3] = 2e-3
    poses[3:, 2, 3] = 3e-4
    poses[4:, :3, :3] = Rotation.from_rotvec([0, 0, 0.2]).as_matrix()
    np.save(folder / "true_start_T_currs.npy", poses)
    np.save(folder / "contact_masks.npy", np.ones((FRAMES, 240, 320), bool))
    np.save(folder / "gradient_maps.npy", np.zeros((FRAMES, 240, 320, 2), np.float16))
    return folder


def test_a_trial(trial):
    sequence = load_sequence(trial)
    assert (sequence.layout, sequence.object_name, sequence.n_frames) == ("tactile_tracking", "avocado", FRAMES)
    assert sequence.name == "TactileTracking/avocado0"
    assert sequence.background is None
    assert sequence.ground_truth_frames == ()
    np.testing.assert_array_equal(np.diff(sequence.stamps_ns), 40_000_000)
    assert sequence.stamps_ns[0] > 0


def test_images_are_portrait_rgb_in_order(trial):
    sequence = load_sequence(trial)
    image = sequence.image(2).astype(int)
    assert image.shape == (320, 240, 3)
    red, blue = image[20, 120], image[160, 220]
    assert red[0] > 180 > 90 > red[2], "what was right is up"
    assert blue[2] > 180 > 90 > blue[0], "what was down is right"
    levels = [sequence.image(i)[160, 60].mean() for i in range(FRAMES)]
    assert (np.diff(levels) > 5).all()


def test_a_no_contact_image_in_the_trial_is_turned_as_its_video(trial, tmp_path):
    cv2.imwrite(str(trial / "background.png"), tactile_image(2))
    sequence = load_sequence(trial)
    off = np.abs(sequence.background.astype(int) - sequence.image(2))
    assert np.median(off) < 3
    cv2.imwrite(str(tmp_path / "upright.png"), sequence.background[:, :, ::-1])
    np.testing.assert_array_equal(sequence.read_background(tmp_path / "upright.png"), sequence.background)


def test_a_trial_is_in_contact_all_along(trial):
    assert "--background, or put it there as background.png" in untouched_of(load_sequence(trial)).doubt
    cv2.imwrite(str(trial / "background.png"), tactile_image(2))
    assert untouched_of(load_sequence(trial)).doubt == ""


def test_poses_are_those_of_our_gel_frame(trial):
    """x right, y up in the portrait image, z towards the camera; the object's frame is the first of them."""
    poses = load_sequence(trial).poses_true
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(poses[1, :3, 3], (0, 1e-3, 0), atol=1e-12, err_msg="right in the landscape image is up")
    np.testing.assert_allclose(poses[2, :3, 3], (2e-3, 1e-3, 0), atol=1e-12)
    np.testing.assert_allclose(poses[3, :3, 3], (2e-3, 1e-3, -3e-4), atol=1e-12, err_msg="into the object is down")
    turn = Rotation.from_matrix(poses[4, :3, :3]).as_rotvec()
    np.testing.assert_allclose(turn, (0, 0, -0.2), atol=1e-9)
    assert np.allclose(se3.inverse(poses) @ poses, np.eye(4))


def in_millimetres(poses: np.ndarray) -> np.ndarray:
    poses[:, :3, 3] *= 1000
    return poses


def with_poses(folder, change) -> None:
    file = folder / "true_start_T_currs.npy"
    np.save(file, change(np.load(file)))


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (lambda f: (f / "gelsight.avi").unlink(), "gelsight.avi"),
        (lambda f: (f / "gelsight.avi").write_bytes(b"RIFF"), r"gelsight\.avi.*get the file again"),
        (lambda f: np.save(f / "true_start_T_currs.npy", np.tile(np.eye(4), (3, 1, 1))), "3 poses.*6 images"),
        (lambda f: np.save(f / "true_start_T_currs.npy", np.zeros((FRAMES, 7))), r"expected \(N, 4, 4\)"),
        (lambda f: np.save(f / "true_start_T_currs.npy", np.zeros((FRAMES, 4, 4))), "0 0 0 1"),
        (lambda f: np.save(f / "true_start_T_currs.npy", np.full((FRAMES, 4, 4), np.nan)), "get the file again"),
        (lambda f: (f / "true_start_T_currs.npy").write_bytes(b"nonsense"), "get the file again"),
        (lambda f: np.save(f / "true_start_T_currs.npy", np.zeros((0, 4, 4))), r"expected \(N, 4, 4\)"),
        (lambda f: with_poses(f, lambda p: p.transpose(0, 2, 1)), "0 0 0 1.*transposed"),
        (lambda f: with_poses(f, lambda p: p @ np.diag([1.0, 1, -1, 1])), "mirrors.*right-handed"),
        (lambda f: with_poses(f, in_millimetres), "Scale.*0.001"),
        (lambda f: with_poses(f, lambda p: p[::-1]), "inv.first. @ pose"),
        (lambda f: write_video(f / "gelsight.avi", [np.zeros((240, 240, 3), np.uint8)] * FRAMES), "avi.*4:3"),
    ],
)
def test_damaged_trials(trial, damage, problem):
    damage(trial)
    with pytest.raises(InputError, match=problem):
        load_sequence(trial)
