"""Inspection of a bag before it is played: what it holds, what of it can be used, what is missing, how to continue.

A few messages are looked at, by the checks of `ReplaySource`, and as many are read as a few seconds allow, so that a
long bag takes hardly longer than a short one.
"""

from __future__ import annotations

import math
import re
import shlex
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, takewhile
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME
from midastouch_common.images import BrokenImageError
from midastouch_common.message_arrays import stamp_ns, xyzquat_from_msg
from midastouch_common.output_paths import SIMULATED, codebook_path
from midastouch_common.transforms.tree import FrameTree
from midastouch_perception.codebook import build_command
from midastouch_perception.objects import bundled_objects

from ..bags.images import decode_image, decode_raw
from ..bags.messages import (
    COMPRESSED_TYPE,
    IMAGE_TOPIC,
    IMAGE_TYPE,
    TF_STATIC_TOPIC,
    TF_TOPIC,
    TF_TYPE,
    Topic,
    header_stamp_ns,
)
from ..bags.reader import bag_duration, bag_messages, bag_metadata, content_of, message_counts
from .source import ReplaySource

_SENSORS = {"simulated": SIMULATED, "tactile_tracking": "gelsight_mini"}  # by the layout that `to-bag` notes
_LIKELY_SENSOR = re.compile("tactile|digit|gelsight", re.IGNORECASE)
_SERIAL = re.compile(r"(?<![A-Za-z0-9])D\d{5}(?!\d)")  # of a DIGIT
_FIRST = 5  # images, of which some may be broken
_LONG_PATH = 6  # frames
_REACH = 10.0  # m, longer than any link of an arm
_READING_S = 3.0
_OTHER_CLOCK_S = 1.0  # stamps that are further apart than the bag is long


@dataclass(frozen=True)
class ImageStream:
    """The images on one topic of a bag, judged by the first of them.

    content: encoding and size; rotation: degrees counter-clockwise by which they have to be turned; problem: why they
    cannot be used, or "".
    """

    topic: str
    content: str
    rotation: int = 0
    problem: str = ""


@dataclass
class Inspection:
    """What was found in a bag.

    rows: topic, type, messages, messages a second, and content of each topic; usable, missing, notes: sentences;
    commands: to continue with.
    """

    duration_s: float
    rows: list[tuple[str, str, int, str, str]]
    usable: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def inspect_bag(path: Path, base: str = BASE_FRAME, gel: str = GEL_FRAME) -> Inspection:
    """Inspect the bag at `path` for a replay that gives the pose of the frame `gel` in `base`.

    Frames of these names with a prefix are found, too. Raises InputError if the bag cannot be read.
    """
    counts, duration = message_counts(path), bag_duration(path)
    streams = {
        topic.name: _image_stream(path, topic)
        for topic, count in counts.items()
        if topic.type_name in (IMAGE_TYPE, COMPRESSED_TYPE) and count
    }
    rows = [_row(topic, count, duration, streams) for topic, count in counts.items()]
    found = Inspection(duration, sorted(rows))
    until = time.monotonic() + _READING_S
    try:
        whole = sum(1 for _ in takewhile(lambda _: time.monotonic() < until, bag_messages(path)))
    except InputError as error:
        found.missing.append(f"whole messages: {error}")
        return found
    if (read := whole / max(sum(counts.values()), 1)) < 1.0:
        found.notes.append(
            f"{read:.0%} of its messages were read, for {_READING_S:g} s; whether the rest is whole is not known"
        )
    images = _chosen(streams.values())
    if images is None:
        found.missing.append(_no_images(counts, streams.values()))
        return found
    found.usable.append(f"images on {images.topic}: {images.content}")
    if others := sorted(s.topic for s in streams.values() if not s.problem and s.topic != images.topic):
        found.notes.append(f"there are images on {', '.join(others)}, too: for those of the sensor, change remap")
    remaps = {name: played for name, played in _remaps(images.topic, counts) if name != played}
    source = ReplaySource(path, remaps=remaps, rotation=images.rotation)
    tree = source.frame_tree(base, gel)
    base, gel = _frame_in(tree, base), _frame_in(tree, gel)
    missing = source.pose_missing(base, gel)
    if missing:
        found.missing.append(f"{missing}, with inspect-bag --base-frame, --gel-frame")
    else:
        found.usable.append(f"poses: {' -> '.join(_path_between(tree, base, gel))}")
        frames = {*tree.ancestors(base), *tree.ancestors(gel)}
        found.missing += _pose_problems(path, images.topic, counts, remaps, frames, duration)
    metadata, truth = bag_metadata(path), source.frame_tree(TRUTH_FRAME, TRUTH_GEL_FRAME).parents
    simulated = "object" in metadata or TRUTH_FRAME in {*truth, *truth.values()}
    sensor = _SENSORS.get(metadata.get("layout", "simulated" if simulated else ""), "digit_real")
    of, mount = (metadata.get("object", ""), sensor), bool(missing and tree.parents)
    found.commands = list(_commands(path, of, images, remaps, (base, gel), mount))
    if sensor != SIMULATED:
        found.notes.append("if the first 32 images show a contact, add background:=IMAGE of the untouched sensor")
    if not (metadata.keys() & {"layout", "object"} or _SERIAL.search(images.topic)):
        why = f"the bag names no sensor, and has {'the' if simulated else 'no'} frame {TRUTH_FRAME} of a simulator"
        found.notes.append(f"{sensor} is a guess, as {why}; for another one, give sensor_model:=")
    return found


def _row(topic: Topic, count: int, duration: float, streams: dict[str, ImageStream]) -> tuple[str, str, int, str, str]:
    rate = f"{count / duration:.1f}" if count > 1 and duration and not topic.latched else "-"
    content = streams[topic.name].content if topic.name in streams else ""
    return topic.name, topic.type_name.replace("/msg/", "/"), count, rate, content


def _image_stream(path: Path, topic: Topic) -> ImageStream:
    stream = ImageStream(topic.name, "", problem=f"{path}: holds broken images only on {topic.name}; record again")
    for message in islice(bag_messages(path, {topic.name}), _FIRST):
        try:
            encoding, pixels = decode_raw(message, path)
            height, width = pixels.shape[:2]
            rotation = 90 if 3 * width == 4 * height else 0
            stream = ImageStream(topic.name, f"{encoding}, {width} x {height}", rotation)
            decode_image(message, path, rotation)
        except BrokenImageError:
            continue
        except InputError as error:
            return replace(stream, problem=str(error))
        return stream
    return stream


def _chosen(streams: Collection[ImageStream]) -> ImageStream | None:
    """Return the images that are most likely a tactile sensor's; None if none can be used."""
    names = (IMAGE_TOPIC, f"{IMAGE_TOPIC}/compressed")

    def rank(stream: ImageStream) -> tuple:
        own = names.index(stream.topic) if stream.topic in names else len(names)
        likely = bool(_LIKELY_SENSOR.search(stream.topic) or _SERIAL.search(stream.topic))
        return own, not likely, stream.rotation, stream.topic.endswith("/compressed"), stream.topic

    return min((stream for stream in streams if not stream.problem), key=rank, default=None)


def _no_images(counts: dict[Topic, int], streams: Collection[ImageStream]) -> str:
    if streams:
        return "; ".join(sorted(stream.problem for stream in streams))
    empty = [topic.name for topic in counts if topic.type_name in (IMAGE_TYPE, COMPRESSED_TYPE)]
    if empty:
        return f"images: there is no message on {', '.join(sorted(empty))}; did the sensor run? Record again"
    return "images: there is no topic of type sensor_msgs/Image or CompressedImage; record those of the sensor"


def _remaps(images: str, counts: dict[Topic, int]) -> Iterator[tuple[str, str]]:
    """Yield the recorded name, and the topic on which it has to be played, of the images and the transforms."""
    yield images, images if images == f"{IMAGE_TOPIC}/compressed" else IMAGE_TOPIC
    for played in (TF_TOPIC, TF_STATIC_TOPIC):
        names = {t.name for t, count in counts.items() if count and t.type_name == TF_TYPE and t.name.endswith(played)}
        if names and played not in names:
            # of several namespaces, that of the images
            yield min(names, key=lambda name: (not images.startswith(name.removesuffix(played)), name)), played


def _frame_in(tree: FrameTree, wanted: str) -> str:
    """Return `wanted`, or the only frame of the tree that is called so behind a prefix."""
    frames = {*tree.parents, *tree.parents.values()}
    prefixed = [frame for frame in frames if frame.endswith(wanted)]
    return prefixed[0] if wanted not in frames and len(prefixed) == 1 else wanted


def _path_between(tree: FrameTree, base: str, gel: str) -> list[str]:
    up, down = tree.ancestors(base), tree.ancestors(gel)
    common = next(frame for frame in up if frame in down)
    path = [*up[: up.index(common) + 1], *reversed(down[: down.index(common)])]
    return path if len(path) <= _LONG_PATH else [*path[:2], "...", *path[-3:]]


def _pose_problems(
    path: Path, images: str, counts: dict[Topic, int], remaps: dict[str, str], frames: Collection[str], duration: float
) -> Iterator[str]:
    """Yield what makes the poses wrong: nothing moves, stamps are of two clocks, lengths are not metres.

    frames: those between the base and the gel.
    """
    names = {topic.name for topic, count in counts.items() if count}
    moving = next((name for name in names if remaps.get(name, name) == TF_TOPIC), None)
    if moving is None:
        yield f"{TF_TOPIC}: all transforms are static, so the sensor never moves; record {TF_TOPIC}, too"
        return
    stamp = header_stamp_ns(next(bag_messages(path, {images})).data)
    first = next(bag_messages(path, {moving}))
    between = [each for each in content_of(first, path).transforms if each.child_frame_id.lstrip("/") in frames]
    apart = min((abs(stamp - stamp_ns(each.header.stamp)) / 1e9 for each in between), default=0.0)
    if apart > duration + _OTHER_CLOCK_S:
        yield (
            f"a common clock: images and transforms are stamped {apart:.0f} s apart, so no image has a pose; "
            "synchronise the clocks of sensor and arm, and record again"
        )
    for each in between:
        if (length := math.hypot(*xyzquat_from_msg(each.transform)[:3])) > _REACH:
            yield (
                f"transforms in metres: '{each.child_frame_id}' is {length:.0f} m from '{each.header.frame_id}'; are "
                "these millimetres?"
            )


def _commands(
    path: Path, of: tuple[str, str], images: ImageStream, remaps: dict[str, str], frames: tuple[str, str], mount: bool
) -> Iterator[str]:
    """Yield the commands that localise with this bag; of: name of the object, or "", and model of the sensor; mount:
    True if the mount has to be published beside it."""
    name, sensor = of
    words = [f"bag:={path}"]
    if name in bundled_objects():
        if not codebook_path(name, sensor).is_file():
            yield build_command(name, "" if sensor == SIMULATED else sensor)
        words.append(f"object:={name}")
    else:
        words.append(f"mesh:=PATH/{name}.ply" if name else "mesh:=YOUR_OBJECT.ply")
        if name and (codebook := codebook_path(name, sensor)).is_file():
            words.append(f"codebook:={codebook}")
    if sensor != SIMULATED:
        words.append(f"sensor_model:={sensor}")
    if serial := _SERIAL.search(images.topic):
        words.append(f"serial:={serial[0]}")
    if remaps:
        words.append(f"remap:={' '.join(f'{name}:={played}' for name, played in remaps.items())}")
    if images.rotation:
        words.append(f"rotation:={images.rotation}")
    base, gel = frames
    prefixes = []
    if base.endswith(BASE_FRAME) and gel.endswith(GEL_FRAME):
        named = {"tf_prefix": base.removesuffix(BASE_FRAME), "sensor_prefix": gel.removesuffix(GEL_FRAME)}
        prefixes = [f"{key}:={prefix}" for key, prefix in named.items() if prefix]
        words += prefixes
    else:
        parameters = f"{{base_frame_id: {base}, sensor_frame_id: {gel}}}"
        yield f"echo '{{/**/particle_filter: {{ros__parameters: {parameters}}}}}' > frames.yaml"
        words.append("params_overlay:=frames.yaml")
    if mount:
        yield shlex.join(["midastouch", "run", "mount", *prefixes]) + "  # in a terminal of its own"
    yield shlex.join(["midastouch", "run", "replay", *words])
