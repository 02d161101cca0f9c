"""Messages that a replay sends: those of a sequence, of plain images, or of a bag without a filter's results."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from midastouch_common.errors import InputError
from midastouch_common.images import BrokenImageError
from midastouch_common.transforms.tree import FrameTree

from ..bags.images import decode_image
from ..bags.messages import (
    CAMERA_INFO_TOPIC,
    COMPRESSED_TOPIC,
    IMAGE_TOPIC,
    IMAGE_TYPE,
    PLAIN_IMAGE_TOPICS,
    SEQUENCE_TOPICS,
    TF_STATIC_TOPIC,
    TF_TOPIC,
    Message,
    Topic,
    image_message,
    plain_image_messages,
    sequence_messages,
    typestore,
)
from ..bags.reader import bag_duration, bag_messages, bag_topics, is_bag, readable
from ..datasets.loading import is_sequence, load_sequence
from ..datasets.plain_images import PlainImages

INPUT_TOPICS = frozenset(
    {IMAGE_TOPIC, COMPRESSED_TOPIC, CAMERA_INFO_TOPIC, TF_TOPIC, TF_STATIC_TOPIC, "/joint_states", "/initialpose"}
)
"""Topics of a bag that are inputs of the pipeline, not its results."""

_FIRST = 2000  # messages of TF: seconds of a recording
_POSE_TOPIC, _OBJECT_FRAME = "/pose", "object"  # of a filter; its default object frame


def is_image(topic: str) -> bool:
    """Return whether a message on this topic ends a frame."""
    return topic.startswith(IMAGE_TOPIC)


class ReplaySource:
    """The sequence, bag, folder of images or video at `path`; `topics` are the ones it will send.

    Of a bag, only the inputs of the pipeline are sent. The pipeline subscribes to raw images: compressed ones are
    decompressed, or left out if there are raw ones, too. An incomplete image, as a lossy network leaves it, is left out
    and counted (`images_broken`); `on_broken` gets the reason. Raises InputError if `path` is none of these or cannot
    be read, also while messages are read.
    """

    def __init__(self, path: str | Path, on_broken: Callable[[str], None] = lambda reason: None) -> None:
        self.path, self._on_broken = Path(path), on_broken
        self.images_broken = 0
        self._decompresses = False
        self._sequence = self._images = None
        if not is_bag(self.path):
            if PlainImages.are_at(self.path) and not is_sequence(self.path):
                self._images, self.topics = PlainImages(self.path), list(PLAIN_IMAGE_TOPICS)
            else:
                self._sequence, self.topics = load_sequence(self.path), list(SEQUENCE_TOPICS)
            return
        present = bag_topics(self.path)
        self.topics = [topic for topic in present if topic.name in INPUT_TOPICS]
        if not any(is_image(topic.name) for topic in self.topics):
            names = ", ".join(sorted(topic.name for topic in present)) or "nothing"
            raise InputError(f"{self.path}: has no images on {IMAGE_TOPIC} or {COMPRESSED_TOPIC}; it has {names}")
        self._estimated = {_OBJECT_FRAME, *self._frames_of(_POSE_TOPIC, present)}
        self._prefer_raw_images()
        self._look_at_the_first_image()

    def messages(self, offset_ns: int = 0) -> Iterator[Message]:
        """Yield each recorded message once, in recorded order, without those of the first `offset_ns`.

        Latched messages of a bag are sent in any case: they hold for the rest, too.
        """
        if self._sequence is not None:
            yield from sequence_messages(self._sequence, offset_ns)
            return
        if self._images is not None:
            yield from plain_image_messages(self._images, offset_ns)
            return
        start = None
        for message in self._bag_messages():
            start = message.stamp_ns + offset_ns if start is None else start
            if message.latched or message.stamp_ns >= start:
                yield message

    @property
    def duration_s(self) -> float:
        """Seconds from the first message of the recording to the last."""
        if self._sequence is not None:
            return int(self._sequence.stamps_ns[-1] - self._sequence.stamps_ns[0]) / 1e9
        if self._images is not None:
            return (self._images.n_frames - 1) / self._images.fps
        return bag_duration(self.path)

    def _prefer_raw_images(self) -> None:
        names = {topic.name for topic in self.topics}
        if COMPRESSED_TOPIC not in names:
            return
        self.topics = [topic for topic in self.topics if topic.name != COMPRESSED_TOPIC]
        if IMAGE_TOPIC not in names:
            self._decompresses = True
            self.topics.append(Topic(IMAGE_TOPIC, IMAGE_TYPE))

    def _look_at_the_first_image(self) -> None:
        """Raise InputError if the pipeline cannot take the images of the bag: they would all be refused one by one."""
        topic = COMPRESSED_TOPIC if self._decompresses else IMAGE_TOPIC
        with contextlib.suppress(BrokenImageError):  # that one is left out
            decode_image(next(bag_messages(self.path, {topic})), self.path)

    def pose_missing(self, base: str, gel: str) -> str:
        """Return in words, with the fix, why the recording has no pose of the frame `gel` in `base`; empty if it has.

        Of a bag, the first transforms of each frame are looked at, up to `_FIRST` messages.
        """
        if self._sequence is not None:
            return ""
        tree = FrameTree()
        links = tree.parents
        if {TF_TOPIC, TF_STATIC_TOPIC} & {topic.name for topic in self.topics}:
            for message in islice(bag_messages(self.path, {TF_TOPIC, TF_STATIC_TOPIC}), _FIRST):
                with readable(self.path):
                    content: Any = typestore().deserialize_cdr(message.data, message.type_name)
                links |= {t.child_frame_id.lstrip("/"): t.header.frame_id.lstrip("/") for t in content.transforms}
        roots = {tree.ancestors(frame.lstrip("/"))[-1] for frame in (base, gel)}
        if len(roots) == 1:
            return ""
        frames = f"; it has the frames {', '.join(sorted({*links, *links.values()}))}" if links else ""
        return (
            f"{self.path}: no recorded transforms lead from '{base}' to '{gel}'{frames}; so there is no pose. "
            "Publish the missing ones beside it (midastouch run mount), or name the frames: tf_prefix, sensor_prefix"
        )

    def _bag_messages(self) -> Iterator[Message]:
        names = {topic.name for topic in self.topics}
        if self._decompresses:
            names = names - {IMAGE_TOPIC} | {COMPRESSED_TOPIC}
        for message in self._without_estimates(bag_messages(self.path, names)):
            try:
                yield self._as_sent(message)
            except BrokenImageError as error:
                self.images_broken += 1
                self._on_broken(str(error))

    def _as_sent(self, message: Message) -> Message:
        if not self._decompresses or message.topic != COMPRESSED_TOPIC:
            return message
        pixels = decode_image(message, self.path)
        content: Any = typestore().deserialize_cdr(message.data, message.type_name)
        return image_message(content.header, pixels, message.stamp_ns)

    def _frames_of(self, topic: str, present: list[Topic]) -> set[str]:
        """The frame of the first message on a topic, if there is one."""
        if topic not in {each.name for each in present}:
            return set()
        first = next(bag_messages(self.path, {topic}))
        with readable(self.path):
            content: Any = typestore().deserialize_cdr(first.data, first.type_name)
            return {content.header.frame_id}

    def _without_estimates(self, messages: Iterator[Message]) -> Iterator[Message]:
        """Drop the frame that a filter published: it would conflict with that of the filter that listens."""
        store = typestore()
        for message in messages:
            if message.topic not in (TF_TOPIC, TF_STATIC_TOPIC):
                yield message
                continue
            with readable(self.path):
                content: Any = store.deserialize_cdr(message.data, message.type_name)
            kept = [t for t in content.transforms if t.child_frame_id not in self._estimated]
            if len(kept) == len(content.transforms):
                yield message
            elif kept:
                content.transforms = kept
                data = bytes(store.serialize_cdr(content, message.type_name))
                yield dataclasses.replace(message, data=data)
