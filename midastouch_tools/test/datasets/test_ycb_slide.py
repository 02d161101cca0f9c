"""Both layouts of YCB-Slide: on the development slides where they exist, on made ones otherwise."""

import pickle
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.datasets import load_sequence

SHARED = Path(__file__).resolve().parents[3].parent / "shared" / "data" / "ycb_slide_sim"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the development slides are not beside the clone")


@needs_shared
@pytest.mark.parametrize("slide", ["005_tomato_soup_can", "025_mug", "035_power_drill"])
def test_development_slides(slide):
    sequence = load_sequence(SHARED / slide / "00")
    assert sequence.object_name == slide
    assert sequence.poses_true.shape == sequence.poses_measured.shape == (sequence.n_frames, 4, 4)
    assert sequence.image(sequence.n_frames - 1).shape == (320, 240, 3)
    assert sequence.background.shape == (320, 240, 3)
    noise = se3.inverse(sequence.poses_true) @ sequence.poses_measured
    assert 0.4e-3 < noise[:, :3, 3].std() < 0.6e-3
    np.testing.assert_array_equal(np.diff(sequence.stamps_ns), 100_000_000)


@needs_shared
def test_truth_from_height_maps_agrees_with_the_exact_one(tmp_path):
    source = SHARED / "025_mug" / "00"
    exact = load_sequence(source)
    for part in ("tactile_images", "gt_heightmaps", "tactile_data.pkl"):
        (tmp_path / part).symlink_to(source / part)
    recovered = load_sequence(tmp_path)
    assert recovered.background is None
    with np.load(source / "penetration_truth.npz") as stored:
        frames = stored["frames"]
    for frame in frames:
        error = recovered.penetration_truth(frame) - exact.penetration_truth(frame)
        assert np.sqrt(np.mean(error**2)) < 0.01e-3
        assert abs(error.mean()) < 0.002e-3
        untouched = exact.penetration_truth(frame) == 0
        assert (recovered.penetration_truth(frame)[untouched] == 0).mean() > 0.98


def test_frames_without_truth_answer_none(simulated_sequence):
    path = simulated_sequence(n=3).path
    (path / "penetration_truth.npz").unlink()
    (path / "gt_heightmaps" / "1.jpg").unlink()
    sequence = load_sequence(path)
    assert sequence.ground_truth_frames == (0, 2)
    assert sequence.penetration_truth(1) is None
    assert sequence.penetration_truth(0).max() > 0.9e-3


def test_images_are_read_only_when_asked_for(simulated_sequence):
    path = simulated_sequence(n=3).path
    (path / "tactile_images" / "1.jpg").write_bytes(b"not an image")
    cv2.imwrite(str(path / "tactile_images" / "2.jpg"), np.zeros((240, 320, 3), np.uint8))
    sequence = load_sequence(path)
    sequence.image(0)
    with pytest.raises(InputError, match=r"1\.jpg.*get the file again"):
        sequence.image(1)
    with pytest.raises(InputError, match=r"2\.jpg.*320 x 240.*240 x 320"):
        sequence.image(2)


def damage(path: Path, **changes) -> None:
    """Rewrite the sequence's pickle with entries replaced, or removed where the change is None."""
    file = path / "tactile_data.pkl"
    data = pickle.loads(file.read_bytes()) | changes
    file.write_bytes(pickle.dumps({key: value for key, value in data.items() if value is not None}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gelposes": None}, "gelposes"),
        ({"gelposes": np.zeros((3, 6))}, r"shape \(3, 6\)"),
        ({"gelposes": np.full((3, 7), np.nan)}, "non-finite"),
        ({"gelposes_meas": np.zeros((3, 7))}, "zero quaternion"),
        ({"gelposes": np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 1))}, "2 gelposes.*3 gelposes_meas"),
        ({"gelposes": [["x"] * 7]}, "numbers"),
    ],
)
def test_bad_poses_are_refused_with_the_file_named(simulated_sequence, changes, message):
    path = simulated_sequence(n=3).path
    damage(path, **changes)
    with pytest.raises(InputError, match=message) as error:
        load_sequence(path)
    assert str(error.value).count("tactile_data.pkl") == 1


def test_missing_image_is_named(simulated_sequence):
    path = simulated_sequence(n=4).path
    (path / "tactile_images" / "2.jpg").unlink()
    with pytest.raises(InputError, match=r"tactile_images.*2\.jpg"):
        load_sequence(path)


def test_damaged_truth_is_named(simulated_sequence):
    path = simulated_sequence(n=2).path
    truth = path / "penetration_truth.npz"
    whole = truth.read_bytes()
    middle = len(whole) // 2
    truth.write_bytes(whole[:middle] + b"\xff" * 60 + whole[middle + 60 :])  # zlib has an error of its own
    with pytest.raises(InputError, match=r"penetration_truth\.npz.*get the file again"):
        load_sequence(path).penetration_truth(0)
    truth.write_bytes(b"PK")
    with pytest.raises(InputError, match=r"penetration_truth\.npz.*get the file again"):
        load_sequence(path)


def test_empty_foreign_and_missing_folders(tmp_path):
    with pytest.raises(InputError, match=r"tactile_data\.pkl.*give the folder"):
        load_sequence(tmp_path)
    (tmp_path / "holiday.jpg").write_bytes(b"")
    with pytest.raises(InputError, match=r"tactile_data\.pkl.*give the folder"):
        load_sequence(tmp_path)
    with pytest.raises(InputError, match=r"nowhere.*check the path"):
        load_sequence(tmp_path / "nowhere")


def test_real_layout_takes_every_second_frame_and_corrects_poses(real_sequence_folder):
    path, truth = real_sequence_folder(n=21)
    sequence = load_sequence(path)
    assert (sequence.layout, sequence.object_name, sequence.n_frames) == ("real", "035_power_drill", 11)
    np.testing.assert_allclose(sequence.poses_true, truth[::2], atol=1e-9)
    assert sequence.poses_measured is sequence.poses_true
    np.testing.assert_allclose(np.diff(sequence.stamps_ns), 1e9 / 15, atol=1)
    assert sequence.image_paths[3].name == "frame_0000006.jpg"
    assert abs(sequence.image(3)[..., 2].mean() - (40 + 170 * 0.6)) < 3  # RGB, and that very frame
    assert (sequence.background, sequence.ground_truth_frames, sequence.dropped_frames) == (None, (), 0)


def jump(*frames):
    def edit(data):
        data["poses"]["DIGIT"][list(frames), :3] += 0.4

    return edit


def lose_some(data):
    data["poses"]["DIGIT"][4] = np.nan
    data["poses"]["035_power_drill"][8, 3:] = 0
    data["timestamps"][12] = data["timestamps"][10]
    data["timestamps"][16] = np.nan


@pytest.mark.parametrize(
    ("edit", "dropped"),
    [(jump(10, 30), (10, 30)), (jump(0), (0,)), (lose_some, (4, 8, 12, 16))],
    ids=["two jumps", "a jump at the start", "lost by the tracker"],
)
def test_jumps_and_lost_poses_are_dropped_with_their_images(real_sequence_folder, edit, dropped):
    path, truth = real_sequence_folder(n=61, edit=edit)
    sequence = load_sequence(path)
    kept = [i for i in range(0, 61, 2) if i not in dropped]
    assert [file.name for file in sequence.image_paths] == [f"frame_{i:07d}.jpg" for i in kept]
    np.testing.assert_allclose(sequence.poses_true, truth[kept], atol=1e-9)
    assert sequence.dropped_frames == len(dropped)
    assert (np.diff(sequence.stamps_ns) > 0).all()


def test_a_fast_start_after_rest_is_no_jump(real_sequence_folder):
    def rest_then_slide(data):
        poses = data["poses"]["DIGIT"]
        poses[:, :3] = poses[0, :3]
        poses[30:, 0] += 0.005 * np.arange(len(poses) - 30)

    path, _ = real_sequence_folder(n=61, edit=rest_then_slide)
    assert load_sequence(path).dropped_frames == 0


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda data: data["poses"]["DIGIT"].fill(np.nan), "choose another sequence"),
        (lambda data: data.pop("poses"), "poses"),
        (lambda data: data["poses"].update({"025_mug": data["poses"]["035_power_drill"]}), "025_mug"),
        (lambda data: data["timestamps"].pop(), "timestamps"),
    ],
)
def test_bad_real_sequences_are_refused(real_sequence_folder, edit, message):
    path, _ = real_sequence_folder(edit=edit)
    with pytest.raises(InputError, match=rf"synced_data\.npy.*{message}"):
        load_sequence(path)


def test_real_sequence_without_its_neighbours(real_sequence_folder):
    path, _ = real_sequence_folder()
    (path / "frames" / "frame_0000004.jpg").unlink()
    with pytest.raises(InputError, match=r"frame_0000004\.jpg.*get the sequence again"):
        load_sequence(path)
    np.save(path.parent / "alignment.npy", np.eye(3))
    with pytest.raises(InputError, match=r"alignment\.npy.*\(4, 4\)"):
        load_sequence(path)
    (path.parent / "alignment.npy").unlink()
    with pytest.raises(InputError, match=r"alignment\.npy.*check the path"):
        load_sequence(path)


def test_image_names_cannot_leave_the_folder(real_sequence_folder):
    def escape(data):
        data["digit_frames"] = [f"../../../{Path(name).name}" for name in data["digit_frames"]]

    path, _ = real_sequence_folder(edit=escape)
    assert all(file.parent == path / "frames" for file in load_sequence(path).image_paths)


def test_a_sequence_does_not_depend_on_where_it_lies(tmp_path, simulated_sequence):
    original = simulated_sequence(n=2)
    copy = tmp_path / "elsewhere" / "7"
    shutil.copytree(original.path, copy)
    moved = load_sequence(copy)
    assert (moved.object_name, moved.name) == ("test_object", "elsewhere/7")
