import numpy as np
import pytest
from recorded import SECOND, STILL, compressed, image, tf, write

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.bags.images import GelStream
from midastouch_tools.export.recording import FILTER_STATES, Recording


def test_every_frame_has_every_column(run):
    sequence, path = run()
    recording = Recording(path)
    rows = list(recording.rows())
    assert len(rows) == sequence.n_frames
    assert recording.object_name == "cup"
    assert recording.rate == pytest.approx(1e9 / np.diff(sequence.stamps_ns)[0])
    names = [column.name for column in recording.columns]
    assert names == [
        "stamp_ns", "image", "base_from_gel", "penetration", "penetration_valid", "estimate", "estimate_valid",
        "filter_state", "truth", "truth_valid",
    ]  # fmt: skip
    for i, row in enumerate(rows):
        assert list(row) == names
        assert row["stamp_ns"] == sequence.stamps_ns[i]
        assert (row["image"] == sequence.image(i)).all()
        assert row["truth"] == pytest.approx(se3.to_xyzquat(sequence.poses_true[i]), abs=1e-6)
        answered = i > 0
        assert row["estimate_valid"] == row["penetration_valid"] == answered
        assert FILTER_STATES[row["filter_state"][0]] == ("converged" if answered else "none")
        assert row["penetration"].sum() == (15 if answered else 0)
        assert row["estimate"] == pytest.approx(row["truth"] if answered else [0, 0, 0, 0, 0, 0, 1], abs=1e-6)


def test_what_the_bag_lacks_is_no_column(run):
    _, path = run(without={"/tactile/penetration", "/pose", "/filter_status"})
    names = {column.name for column in Recording(path).columns}
    assert names == {"stamp_ns", "image", "base_from_gel", "truth", "truth_valid"}


def test_a_frame_recorded_twice_comes_once(run):
    sequence, path = run(repeated=[2, 3], waited=[3])
    assert [row["stamp_ns"][0] for row in Recording(path).rows()] == sequence.stamps_ns.tolist()


STAMPS = [SECOND, SECOND + SECOND // 10]


@pytest.mark.parametrize(
    ("messages", "stream"),
    [
        ([m for stamp in STAMPS for m in (tf(stamp, STILL), compressed(image(stamp)))], GelStream()),
        (
            [m for s in STAMPS for m in (tf(s, STILL, "a_base", "left_gel"), image(s, topic="/left/image_raw"))],
            GelStream("/left/image_raw", "a_base", "left_gel"),
        ),
    ],
    ids=["compressed images alone", "the left finger of another arm"],
)
def test_a_bag_without_our_images_or_names_is_a_recording(tmp_path, messages, stream):
    recording = Recording(write(tmp_path / "x.mcap", *messages), stream)
    assert recording.rate == pytest.approx(10)
    assert [row["stamp_ns"][0] for row in recording.rows()] == STAMPS


def test_a_folder_is_no_bag(tmp_path):
    with pytest.raises(InputError, match="not a bag"):
        Recording(tmp_path)
