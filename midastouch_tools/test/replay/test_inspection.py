"""Foreign bags, as a stranger brings them: each is played by the command that is shown, or refused with the fix."""

import dataclasses
import re
import shlex
from functools import partial

import foreign_bags as bags
import numpy as np
import pytest
from recorded import SECOND, STILL, edited, tf
from rosbags.rosbag2 import StoragePlugin
from sequences import smooth_image

from midastouch_tools.cli import main
from midastouch_tools.replay.source import ReplaySource, parsed_remaps
from midastouch_tools.ros.launch_file import values

REAL = {"sensor_model": "digit_real"}
OF_ONE = {**REAL, "serial": "D20123"}


def moved(**topics):
    """The messages of `bags.recorded` with topics renamed."""
    names = {f"/{old}": new for old, new in topics.items()}
    return bags.recorded(lambda message: dataclasses.replace(message, topic=names.get(message.topic, message.topic)))


def framed(base, gel):
    """The messages of `bags.recorded` with frames renamed."""
    names = {"base_link": base, "digit_gel_frame": gel}

    def rename(content):
        for each in content.transforms:
            each.header.frame_id = names.get(each.header.frame_id, each.header.frame_id)
            each.child_frame_id = names.get(each.child_frame_id, each.child_frame_id)

    return bags.recorded(lambda message: edited(message, rename) if message.topic.startswith("/tf") else message)


def of(messages, **options):
    return lambda path: bags.plain(path, messages, **options)


@pytest.fixture
def inspected(tmp_path, monkeypatch, capsys):
    """Calls the command on the bag that a function makes; returns status, standard output and error."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)

    def inspect(make, name="bag", *options):
        path = make(tmp_path / name)
        return main(["inspect-bag", str(path), *options]), *capsys.readouterr()

    return inspect


def arguments_of(out):
    """The arguments of the launch file in the command that is shown, checked as `midastouch run` checks them."""
    command = next(line for line in out.splitlines() if line.startswith("  midastouch run replay"))
    program, run, setup, *words = shlex.split(command)
    assert (program, run, setup) == ("midastouch", "run", "replay")
    given = values("replay", words)
    return {word.partition(":=")[0]: given[word.partition(":=")[0]] for word in words}


@pytest.mark.parametrize(
    ("make", "name", "extra"),
    [
        (bags.of_humble, "bag", REAL),
        (bags.zstd_files, "bag", REAL),
        (partial(bags.zstd_files, storage=StoragePlugin.MCAP), "bag", REAL),
        (bags.zstd_messages, "bag", REAL),
        (partial(bags.zstd_messages, storage=StoragePlugin.MCAP), "bag", REAL),
        (bags.split, "bag", REAL),
        (bags.without_index, "bag.mcap", REAL),
        (of(bags.recorded(), qos=[bags.BEST_EFFORT]), "a bag's", REAL),
        (
            of(bags.images_as(bags.raw(bags.RAW, "bgr8", bags.landscape))),
            "bag",
            {**OF_ONE, "remap": f"{bags.RAW}:=/image_raw", "rotation": "90"},
        ),
        (of(bags.images_as(bags.raw(bags.RAW))), "bag", {**OF_ONE, "remap": f"{bags.RAW}:=/image_raw"}),
        (of(bags.images_as(bags.small("/image_raw/compressed"))), "bag", REAL),
        (
            of(bags.images_as(bags.small(f"{bags.RAW}/compressed"))),
            "bag",
            {**OF_ONE, "remap": f"{bags.RAW}/compressed:=/image_raw"},
        ),
        (
            of(moved(image_raw="/left/image_raw", tf="/left/tf", tf_static="/left/tf_static")),
            "bag",
            {**REAL, "remap": "/left/image_raw:=/image_raw /left/tf:=/tf /left/tf_static:=/tf_static"},
        ),
        (of([tf(SECOND, STILL, "base_link", "object_ground_truth"), *bags.recorded()]), "bag", {}),
        (
            of(framed("arm_base_link", "left_digit_gel_frame")),
            "bag",
            {**REAL, "tf_prefix": "arm_", "sensor_prefix": "left_"},
        ),
    ],
)
def test_a_foreign_bag_is_played_by_the_command_that_is_shown(inspected, make, name, extra):
    status, out, err = inspected(make, name)
    assert (status, err) == (0, ""), out
    assert "missing:" not in out
    guess = f"digit_{'real' if extra else 'tacto'} is a guess"
    assert (guess in out) == ("serial" not in extra), "a serial number is a real sensor's"
    given = arguments_of(out)
    bag = given.pop("bag")
    assert given == {"mesh": "YOUR_OBJECT.ply", **extra}
    source = ReplaySource(
        bag, remaps=parsed_remaps(given.get("remap", "").split()), rotation=int(given.get("rotation", 0))
    )
    played = list(source.messages())
    assert {message.topic for message in played} == {"/image_raw", "/tf", "/tf_static"}
    assert {message.topic for message in played if message.latched} == {"/tf_static"}
    images = [m.content for m in played if m.topic == "/image_raw"]
    assert len(images) == bags.N_IMAGES
    for i, message in enumerate(images):
        assert (message.height, message.width, message.encoding) == (320, 240, "rgb8")
        off = message.data.reshape(320, 240, 3).astype(int) - smooth_image(i)
        assert np.abs(off).max() <= 3  # of scaling to 640 x 480 and back


def test_a_bag_without_its_end_is_played_up_to_there(inspected):
    status, out, err = inspected(bags.cut_off, "bag.mcap")
    assert (status, err.count("\n")) == (0, 1), out
    assert re.search(r"bag\.mcap: unfinished, as a recorder leaves it that is killed; read 4 messages of 0\.1 s", err)
    played = ReplaySource(arguments_of(out)["bag"]).messages()
    assert [message.topic for message in played] == ["/tf_static", "/tf", "/image_raw", "/tf"]


@pytest.mark.parametrize(
    ("make", "name", "reason"),
    [
        (bags.damaged, "bag.mcap", "mcap recover"),
        (bags.without_metadata, "bag", "ros2 bag reindex"),
        (
            lambda path: (bags.plain(path) / "metadata.yaml").write_text("[") and path,
            "bag",
            "write it again: ros2 bag reindex",
        ),
        (bags.part_of_one, "bag.db3", "give its folder"),
        (bags.with_a_part_missing, "bag", "bag_1.mcap"),
        (bags.listed_otherwise, "bag", "ros2 bag reindex"),
        (lambda path: path.write_bytes(b"#ROSBAG V2.0\n") and path, "old.bag", "rosbags-convert --src"),
        (lambda path: path, "none", "no such file"),
        (lambda path: path.mkdir() or path, "empty", "not a bag"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line_with_the_fix(inspected, make, name, reason):
    status, out, err = inspected(make, name)
    assert (status, out) == (2, "")
    assert err.startswith("midastouch: error: ")
    assert err.count("\n") == 1
    assert reason in err


@pytest.mark.parametrize(
    ("messages", "missing", "command"),
    [
        (bags.recorded()[2::2], "no recorded transforms lead from 'base_link'", "midastouch run replay"),
        (
            [message for message in bags.recorded() if message.topic != "/tf_static"],
            "'digit_gel_frame'; it has the frames base_link, tool0",
            "midastouch run mount  # in a terminal of its own",
        ),
        ([tf(SECOND, STILL, topic="/tf_static"), *bags.recorded()[2::2]], "/tf: all transforms are static", ""),
        (bags.images_as(bags.raw("/image_raw", "mono8", lambda p: p[..., 0])), "encoding 'mono8' is not one of", ""),
        (bags.images_as(bags.raw("/image_raw", change=lambda p: p[:1, :1])), "1 x 1 pixels, expected 240 x 320", ""),
        (bags.images_as(bags.raw("/image_raw", change=lambda p: p[:, :90])), "crop it to portrait", ""),
        ([m for m in bags.recorded() if m.topic != "/image_raw"], "record those of the sensor", ""),
        (bags.images_as(bags.broken), "holds broken images only on /image_raw/compressed", ""),
        (
            [*bags.recorded()[2::2], *(tf(late * SECOND, STILL, recorded_ns=SECOND) for late in (90, 91))],
            "stamped 89 s apart",
            "",
        ),
        (
            [tf(SECOND, [450.0, 0, 0, 0, 0, 0, 1], recorded_ns=SECOND // 2), *bags.recorded()],
            "'digit_gel_frame' is 450 m from 'base_link'; are these millimetres?",
            "",
        ),
    ],
)
def test_what_is_missing_is_named(inspected, messages, missing, command):
    status, out, err = inspected(of(messages))
    assert (status, err) == (1, "")
    assert missing in out.partition("missing:")[2]
    assert command in out


def test_damage_further_on_is_missing(inspected, simulated_sequence):
    """In a chunk of which no image is looked at."""

    def damaged(path):
        assert main(["to-bag", str(simulated_sequence(n=40).path), "--out", str(path)]) == 0
        data = bytearray(path.read_bytes())
        at = len(data) // 2
        data[at : at + 1000] = bytes(1000)
        path.write_bytes(data)
        return path

    status, out, _ = inspected(damaged, "bag.mcap")
    assert status == 1
    assert "mcap recover" in out.partition("missing:")[2]
    assert "continue with" not in out


def test_a_sequence_is_no_bag(inspected, simulated_sequence):
    status, _, err = inspected(lambda _: simulated_sequence(n=2).path)
    assert status == 2
    assert "midastouch evaluate reads it" in err


def test_of_several_cameras_the_likely_sensor_is_taken(inspected):
    scene = [dataclasses.replace(m, topic="/camera/image_raw") for m in bags.recorded() if m.topic == "/image_raw"]
    status, out, _ = inspected(of([*bags.images_as(bags.raw(bags.RAW)), *scene]))
    assert status == 0
    assert arguments_of(out)["remap"] == f"{bags.RAW}:=/image_raw"
    assert "there are images on /camera/image_raw, too" in out


def test_frames_of_other_names_go_into_a_parameter_file(inspected, tmp_path):
    make = of(framed("part", "finger"))
    status, out, _ = inspected(make)
    assert status == 1
    assert "it has the frames finger, part, tool0" in out
    status, out, _ = inspected(lambda path: path, "bag", "--base-frame", "part", "--gel-frame", "finger")
    assert status == 0
    assert "poses: part -> tool0 -> finger" in out
    echo = next(line for line in out.splitlines() if line.strip().startswith("echo"))
    (tmp_path / "frames.yaml").write_text(shlex.split(echo)[1])
    assert arguments_of(out)["params_overlay"] == "frames.yaml"
