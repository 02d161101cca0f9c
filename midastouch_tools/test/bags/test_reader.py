"""Bags that are damaged, foreign or empty are refused in words."""

import mcap.reader
import pytest
from foreign_bags import zstd_files
from recorded import write
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from midastouch_common.errors import InputError
from midastouch_tools.bags import reader
from midastouch_tools.bags.images import read_bag
from midastouch_tools.bags.messages import IMAGE_TYPE, sequence_messages, typestore
from midastouch_tools.bags.reader import bag_messages, bag_metadata, bag_topics, is_bag
from midastouch_tools.bags.writer import write_bag


def test_damaged_and_foreign_bags(tmp_path, simulated_sequence):
    whole = tmp_path / "whole.mcap"
    write_bag(simulated_sequence(n=3), whole)
    content = whole.read_bytes()
    bad = tmp_path / "bad.mcap"
    of_no_bag, part = "its content is not MCAP", "bad"
    for damaged, reason in {
        b"": of_no_bag, b"a picture": of_no_bag, content[:100]: part, content[:9] + bytes(200) + content[209:]: part
    }.items():  # fmt: skip
        bad.write_bytes(damaged)
        with pytest.raises(InputError, match=rf"bad\.mcap.*{reason}|{reason}\.mcap"):
            list(read_bag(bad))
    (tmp_path / "part_of_a_bag.db3").touch()
    (tmp_path / "of_ros_1.bag").touch()
    for name, reason in {
        "nowhere.mcap": "no such file",
        "": r"without its metadata\.yaml.*reindex",
        "test_object": "not a bag",
        "part_of_a_bag.db3": "single file of a bag; give its folder",
        "of_ros_1.bag": "of ROS 1; convert it: rosbags-convert --src",
    }.items():
        foreign = tmp_path / name
        assert not is_bag(foreign)
        for read in (lambda path: list(bag_messages(path)), bag_metadata):
            with pytest.raises(InputError, match=reason):
                read(foreign)


def test_of_a_bag_without_its_end_the_whole_chunks_are_read(tmp_path, simulated_sequence, capsys):
    path = tmp_path / "run.mcap"
    write_bag(simulated_sequence(n=12), path)
    whole, messages, topics = path.read_bytes(), list(bag_messages(path)), bag_topics(path)
    with path.open("rb") as stream:
        chunks = mcap.reader.make_reader(stream).get_summary().chunk_indexes
    assert len(chunks) == 3
    path.write_bytes(whole[:-1])
    assert list(bag_messages(path)) == messages
    assert bag_topics(path) == topics
    assert bag_metadata(path) == {}
    assert (
        capsys.readouterr().err
        == f"{path}: unfinished, as a recorder leaves it that is killed; read 37 messages of 1.1 s\n"
    )
    path.write_bytes(whole[: chunks[2].chunk_start_offset + chunks[2].chunk_length - 1])
    found = list(bag_messages(path))
    assert 0 < len(found) < len(messages)
    assert found == messages[: len(found)]


def test_unknown_types_and_empty_topics_do_no_harm(tmp_path, simulated_sequence):
    """`ros2 bag record -a` keeps what nobody sent, and types that are installed on that machine only."""
    path = tmp_path / "slide"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        odd = writer.add_connection("/odd", "vendor_msgs/msg/Odd", msgdef="vendor_msgs/Gone x\n", rihs01="RIHS01_0")
        writer.write(odd, 1, b"????")
        writer.add_connection("/image_raw", IMAGE_TYPE, typestore=typestore())
        for message in sequence_messages(simulated_sequence(n=2)):
            name = f"{message.topic}/full" if message.topic == "/image_raw" else message.topic
            if name not in {c.topic for c in writer.connections}:
                writer.add_connection(name, message.type_name, typestore=typestore())
            (connection,) = (c for c in writer.connections if c.topic == name)
            writer.write(connection, message.stamp_ns, message.data)
    assert {topic.name for topic in bag_topics(path)} == {
        "/odd",
        "/tf",
        "/tf_static",
        "/camera_info",
        "/image_raw/full",
    }
    assert len(list(bag_messages(path, {"/tf"}))) == 2
    # no profiles were noted: what is sent once only is latched by its name
    assert [topic.name for topic in bag_topics(path) if topic.latched] == ["/tf_static"]


def test_an_empty_bag_is_a_bag(tmp_path):
    path = write(tmp_path / "x.mcap")
    assert bag_metadata(path) == {}
    with pytest.raises(InputError, match="it has nothing"):
        list(read_bag(path))


def test_compressed_files_are_unpacked_once(tmp_path, monkeypatch):
    """In long bags this takes seconds."""
    path, opened = zstd_files(tmp_path / "slow"), []
    monkeypatch.setattr(reader, "Reader", lambda path: opened.append(path) or Reader(path))
    assert len(bag_topics(path)) == 3
    images = bag_messages(path, {"/image_raw"})
    first = next(images)
    assert next(bag_messages(path, {"/image_raw"})) == first
    assert [first, *images] == list(bag_messages(path, {"/image_raw"}))
    assert opened == [path]
