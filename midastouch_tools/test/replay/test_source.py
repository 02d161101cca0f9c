"""The order in which a replay sends, and what it leaves out."""

import dataclasses
import re

import numpy as np
import pytest
from recorded import compressed, cut_off, edited, write

from midastouch_common.errors import InputError
from midastouch_tools.bags.messages import Message, header, sequence_messages
from midastouch_tools.bags.messages import new_message as new
from midastouch_tools.bags.writer import write_bag
from midastouch_tools.replay.source import ReplaySource


def renamed(message: Message, *children: str) -> Message:
    """A transform message with its frames renamed."""

    def rename(content):
        for transform, child in zip(content.transforms, children, strict=True):
            transform.child_frame_id = child

    return edited(message, rename)


def children(message: Message) -> list[str]:
    return [transform.child_frame_id for transform in message.content.transforms]


def test_bag_and_sequence_send_the_same_bytes(tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=4)
    write_bag(sequence, tmp_path / "x.mcap")
    direct = list(ReplaySource(sequence.path).messages())
    assert list(ReplaySource(tmp_path / "x.mcap").messages()) == direct
    assert direct == list(sequence_messages(sequence))


def test_a_later_start_leaves_out_all_but_what_is_latched(tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=6)
    write_bag(sequence, tmp_path / "x.mcap")
    offset = int(sequence.stamps_ns[4] - sequence.stamps_ns[0])
    late = sequence.stamps_ns[4:].tolist()
    for source in (sequence.path, tmp_path / "x.mcap"):
        messages = list(ReplaySource(source).messages(offset))
        assert [m.stamp_ns for m in messages if m.topic == "/image_raw"] == late
        assert [m.stamp_ns for m in messages if m.topic == "/tf"] == late
        assert [m.topic for m in messages if m.latched] == ["/tf_static"]


def test_frames_left_out_are_not_read(simulated_sequence):
    sequence = simulated_sequence(n=4)
    sequence.image_paths[0].write_bytes(b"")
    messages = list(ReplaySource(sequence.path).messages(offset_ns=1))
    assert len([m for m in messages if m.topic == "/image_raw"]) == 3


def test_results_in_a_bag_are_not_played(tmp_path, simulated_sequence):
    static, transforms, info, image = list(sequence_messages(simulated_sequence(n=1)))
    status = dataclasses.replace(image, topic="/tactile/penetration")
    moved, estimated = renamed(transforms, "object", "tool0"), renamed(transforms, "object", "object")
    write(tmp_path / "x.mcap", static, moved, estimated, info, status, image)
    played = list(ReplaySource(tmp_path / "x.mcap").messages())
    assert [m.topic for m in played] == ["/tf_static", "/tf", "/camera_info", "/image_raw"]
    assert children(played[1]) == ["tool0"]


@pytest.mark.parametrize("seed", range(5))
def test_what_is_sent_is_what_the_recording_holds_in_its_order(tmp_path, simulated_sequence, seed):
    """Whatever came late, twice, or of a time before."""
    rng = np.random.default_rng(seed)
    messages = list(sequence_messages(simulated_sequence(n=8)))
    recorded = [*messages, *(messages[i] for i in rng.integers(len(messages), size=6))]
    first, last = messages[0].stamp_ns, messages[-1].stamp_ns
    order = rng.permutation(len(recorded))
    times = np.sort(rng.integers(first, last, size=len(recorded)))
    recorded = [dataclasses.replace(recorded[i], stamp_ns=int(t)) for i, t in zip(order, times, strict=True)]
    write(tmp_path / "x.mcap", *recorded)
    source = ReplaySource(tmp_path / "x.mcap")
    assert list(source.messages()) == recorded
    assert source.duration_s == pytest.approx(1e-9 * (times[-1] - times[0]))
    offset = int(times[9] - times[0])
    assert list(source.messages(offset)) == [m for m in recorded if m.latched or m.stamp_ns >= times[9]]


def test_the_duration_of_a_sequence(simulated_sequence):
    sequence = simulated_sequence(n=11)
    assert ReplaySource(sequence.path).duration_s == pytest.approx(1.0)


def test_compressed_images_are_sent_once_as_raw_ones(tmp_path, simulated_sequence):
    messages = list(sequence_messages(simulated_sequence(n=3)))
    small = [compressed(m) if m.topic == "/image_raw" else m for m in messages]
    both = [copy for m, s in zip(messages, small, strict=True) for copy in ([m] if m is s else [m, s])]
    for name, recorded in (("small", small), ("both", both)):
        write(tmp_path / f"{name}.mcap", *recorded)
        source = ReplaySource(tmp_path / f"{name}.mcap")
        assert {topic.name for topic in source.topics} == {m.topic for m in messages}
        images = [m for m in source.messages() if m.topic.startswith("/image_raw")]
        assert images == [m for m in messages if m.topic == "/image_raw"]


def test_transforms_that_cannot_be_read_are_bad_input(tmp_path, simulated_sequence):
    static, transforms, _, image = list(sequence_messages(simulated_sequence(n=1)))
    write(tmp_path / "x.mcap", static, dataclasses.replace(transforms, data=transforms.data[:20]), image)
    with pytest.raises(InputError, match=r"x\.mcap: cannot be read as a bag"):
        list(ReplaySource(tmp_path / "x.mcap").messages())


def test_neither_bag_nor_sequence(tmp_path):
    with pytest.raises(InputError, match="not a YCB-Slide sequence"):
        list(ReplaySource(tmp_path).messages())
    (tmp_path / "x_0.mcap").touch()
    with pytest.raises(InputError, match=r"without its metadata\.yaml.*reindex"):
        list(ReplaySource(tmp_path).messages())


def test_a_bag_without_images_is_refused_with_what_it_has(tmp_path, simulated_sequence):
    """Nobody would listen to it, as to the bag of a namespace."""
    static, transforms, _, image = list(sequence_messages(simulated_sequence(n=1)))
    write(tmp_path / "x.mcap", static, transforms, dataclasses.replace(image, topic="/left/image_raw"))
    with pytest.raises(InputError, match=r"no images on /image_raw .* it has /left/image_raw, /tf, /tf_static"):
        ReplaySource(tmp_path / "x.mcap")


def test_estimates_are_left_out_under_any_object_frame_name(tmp_path, simulated_sequence):
    _, transforms, _, image = list(sequence_messages(simulated_sequence(n=1)))
    found = new("geometry_msgs/msg/PoseWithCovarianceStamped", header=header(image.stamp_ns, "mug"))
    estimate = Message.of("/pose", found, image.stamp_ns)
    write(tmp_path / "x.mcap", renamed(transforms, "mug", "tool0"), estimate, image)
    played = list(ReplaySource(tmp_path / "x.mcap").messages())
    assert [m.topic for m in played] == ["/tf", "/image_raw"]
    assert children(played[0]) == ["tool0"]


def test_topics_are_known_before_the_first_message(tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=2)
    write_bag(sequence, tmp_path / "x.mcap")
    of_sequence, of_bag = ReplaySource(sequence.path).topics, ReplaySource(tmp_path / "x.mcap").topics
    assert set(of_sequence) == set(of_bag)
    assert {m.topic for m in sequence_messages(sequence)} == {topic.name for topic in of_bag}


def test_plain_images_are_sent_as_a_sequence_without_transforms(tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=3)
    source = ReplaySource(sequence.path / "tactile_images")
    messages, images = list(source.messages()), [m for m in sequence_messages(sequence) if m.topic == "/image_raw"]
    assert [m.topic for m in messages] == ["/camera_info", "/image_raw"] * 3
    assert {m.topic for m in messages} == {topic.name for topic in source.topics}
    assert [m.data[-1000:] for m in messages[1::2]] == [m.data[-1000:] for m in images]
    assert len(list(source.messages(offset_ns=1))) == 4
    assert source.duration_s == pytest.approx(2 / 60)


def test_a_broken_image_of_a_bag_is_left_out_and_the_rest_sent(tmp_path, simulated_sequence):
    messages = list(sequence_messages(simulated_sequence(n=3)))
    images = [i for i, m in enumerate(messages) if m.topic == "/image_raw"]
    for i in images:
        messages[i] = compressed(messages[i], ".jpg")
    messages[images[1]] = cut_off(messages[images[1]])
    write(tmp_path / "x.mcap", *messages)
    reasons = []
    source = ReplaySource(tmp_path / "x.mcap", reasons.append)
    sent = [m.stamp_ns for m in source.messages() if m.topic == "/image_raw"]
    assert sent == [messages[images[0]].stamp_ns, messages[images[2]].stamp_ns]
    assert source.images_broken == len(reasons) == 1
    assert re.search(r"x\.mcap: image on /image_raw/compressed.* is cut off.*record it again", reasons[0])
