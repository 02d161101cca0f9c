"""A slide with known poses, from a sequence and from a bag of the same."""

import numpy as np
import pytest
from recorded import SECOND, image, tf, write

from midastouch_bringup.bags.frames import GelStream
from midastouch_bringup.bags.messages import SEQUENCE_TOPICS, sequence_messages
from midastouch_bringup.bags.posed_slide import PosedSlide
from midastouch_bringup.bags.writer import BagWriter, write_bag
from midastouch_common.errors import InputError


@pytest.fixture
def bag(simulated_sequence, tmp_path):
    sequence = simulated_sequence(n=5)
    path = tmp_path / "slide.mcap"
    write_bag(sequence, path)
    return sequence, path


def test_a_bag_has_the_poses_and_images_of_its_sequence(bag):
    sequence, path = bag
    of_sequence, of_bag = PosedSlide(sequence.path), PosedSlide(path)
    np.testing.assert_array_equal(of_sequence.poses, sequence.poses_measured)
    np.testing.assert_allclose(of_bag.poses, sequence.poses_measured, atol=1e-9)
    for slide in (of_sequence, of_bag):
        images = slide.images([3, 1])
        np.testing.assert_array_equal(images, [sequence.image(1), sequence.image(3)])


def test_a_sequence_brings_its_background_and_a_bag_has_none(bag):
    sequence, path = bag
    kept = np.zeros((320, 240, 3), np.uint8)
    np.testing.assert_array_equal(PosedSlide(sequence.path).background(kept), sequence.background)
    assert PosedSlide(path).background(kept) is kept
    with pytest.raises(InputError, match="capture the sensor's no-contact image"):
        PosedSlide(path).background()  # its images have hardly anything in common


def test_a_bag_without_the_object_s_place_is_refused(simulated_sequence, tmp_path):
    path = tmp_path / "slide.mcap"
    with BagWriter(path) as out:
        for message in sequence_messages(simulated_sequence(n=3)):
            if message.topic != SEQUENCE_TOPICS[0].name:  # which says where the object is
                out.write(message)
    with pytest.raises(InputError, match="object_ground_truth"):
        PosedSlide(path)


def test_what_is_no_slide_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such sequence folder"):
        PosedSlide(tmp_path / "nothing")


def test_topic_and_frames_of_a_bag_may_have_other_names(tmp_path):
    turned = [0.2, 0, 0, 0, 0, 1, 0]
    messages = [
        message
        for stamp in (SECOND, 2 * SECOND)
        for message in (tf(stamp, turned, "part", "left_gel"), image(stamp, topic="/left/image_raw"))
    ]
    stream = GelStream("/left/image_raw", "part", "left_gel")
    slide = PosedSlide(write(tmp_path / "left.mcap", *messages), stream)
    np.testing.assert_allclose(slide.poses[:, 0, 3], 0.2)
    assert len(slide.images([0, 1])) == 2
