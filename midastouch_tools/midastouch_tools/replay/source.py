"""Messages that a replay sends: those of a sequence, of plain images, or of a bag without a filter's results."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from types import MappingProxyType

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
)
from ..bags.reader import bag_duration, bag_messages, bag_topics, content_of, readable
from ..datasets.loading import is_bag, is_sequence, load_sequence, no_whole_bag
from ..datasets.plain_images import PlainImages
from ..datasets.sequence import IMAGE_SHAPE

INPUT_TOPICS = frozenset(
    {IMAGE_TOPIC, COMPRESSED_TOPIC, CAMERA_INFO_TOPIC, TF_TOPIC, TF_STATIC_TOPIC, "/joint_states", "/initialpose"}
)
"""Topics of a bag that are inputs of the pipeline, not its results."""

_TRANSFORMS = (TF_TOPIC, TF_STATIC_TOPIC)
_FIRST, _FIRST_NS = 2000, 20_000_000_000  # messages of TF, and of the recording
_POSE_TOPIC, _OBJECT_FRAME = "/pose", "object"  # of a filter; its default object frame


def is_image(topic: str) -> bool:
    """Return whether a message on this topic ends a frame."""
    return topic.startswith(IMAGE_TOPIC)


def parsed_remaps(words: Iterable[str]) -> dict[str, str]:
    """Return the topic on which each recorded topic is played, from words FROM:=TO. Raises InputError for others."""
    remaps = {}
    for word in words:
        recorded, separator, played = word.partition(":=")
        if not separator or played not in INPUT_TOPICS:
            raise InputError(f"remap {word}: write FROM:=TO, where TO is one of {', '.join(sorted(INPUT_TOPICS))}")
        remaps[recorded] = played
    return remaps


class ReplaySource:
    """The sequence, bag, folder of images or video at `path`; `topics` are the ones it will send, `duration_s` the
    seconds from the first message of the recording to the last.

    Of a bag, only the inputs of the pipeline are sent. The pipeline subscribes to raw images of one size: others are
    converted, and compressed ones left out if there are raw ones, too. An incomplete image, as a lossy network leaves
    it, is left out and counted (`images_broken`); `on_broken` gets the reason. remaps: of topics of a bag, by recorded
    name, as from `parsed_remaps`; rotation: degrees counter-clockwise by which the images of a bag or folder are
    turned. Raises InputError if `path` is none of these or cannot be read, also while messages are read.
    """

    def __init__(
        self,
        path: str | Path,
        on_broken: Callable[[str], None] = lambda reason: None,
        remaps: Mapping[str, str] = MappingProxyType({}),
        rotation: int = 0,
    ) -> None:
        self.path, self._on_broken, self._rotation = Path(path), on_broken, rotation
        self.images_broken, self._is_sequence = 0, False
        self._played: dict[str, Topic] = {}
        self._read: Callable[[int], Iterator[Message]] = self._of_bag
        if not is_bag(self.path):
            if problem := no_whole_bag(self.path):
                raise InputError(problem)
            if PlainImages.are_at(self.path) and not is_sequence(self.path):
                images = PlainImages(self.path, rotation)
                self._read = partial(plain_image_messages, images)
                self.topics, self.duration_s = list(PLAIN_IMAGE_TOPICS), (images.n_frames - 1) / images.fps
            else:
                sequence, self._is_sequence = load_sequence(self.path), True
                self._read = partial(sequence_messages, sequence)
                self.topics = list(SEQUENCE_TOPICS)
                self.duration_s = int(sequence.stamps_ns[-1] - sequence.stamps_ns[0]) / 1e9
            return
        present = bag_topics(self.path)
        self._played = self._inputs(present, remaps)  # topic by recorded name
        self._estimated = {_OBJECT_FRAME, *self._frames_of(_POSE_TOPIC, present)}
        self._image_topic = self._choose_images()
        self.topics, self.duration_s = list(self._played.values()), bag_duration(self.path)
        self._converts = self._must_convert()

    def messages(self, offset_ns: int = 0) -> Iterator[Message]:
        """Return each recorded message once, in recorded order, without those of the first `offset_ns`.

        Latched messages of a bag are sent in any case: they hold for the rest, too.
        """
        return self._read(offset_ns)

    def _inputs(self, present: list[Topic], remaps: Mapping[str, str]) -> dict[str, Topic]:
        """Return the topic on which each input of a bag is played, by its recorded name."""
        names = ", ".join(sorted(topic.name for topic in present)) or "nothing"
        if unknown := sorted(remaps.keys() - {topic.name for topic in present}):
            raise InputError(f"remap {unknown[0]}: {self.path} has no such topic; it has {names}")
        played = {}
        for topic in present:
            name = remaps.get(topic.name, topic.name)
            if name in INPUT_TOPICS and (topic.name in remaps or name not in remaps.values()):
                played[topic.name] = Topic(name, topic.type_name, topic.latched or name == TF_STATIC_TOPIC)
        if not any(is_image(topic.name) for topic in played.values()):
            raise InputError(
                f"{self.path}: has no images on {IMAGE_TOPIC} or {COMPRESSED_TOPIC}; it has {names}; how to play it: "
                f"midastouch inspect-bag {self.path}"
            )
        return played

    def _choose_images(self) -> str:
        """Return the recorded name of the images, raw ones if there are any; drop other ones."""
        recorded = {topic.name: name for name, topic in self._played.items() if is_image(topic.name)}
        chosen = recorded.get(IMAGE_TOPIC) or recorded[COMPRESSED_TOPIC]
        for name in recorded.values():
            del self._played[name]
        self._played[chosen] = Topic(IMAGE_TOPIC, IMAGE_TYPE)
        return chosen

    def _must_convert(self) -> bool:
        """Return whether the images are not yet as the pipeline takes them.

        Raises InputError if it cannot take the first one: all would be refused, one by one.
        """
        first = next(bag_messages(self.path, {self._image_topic}))
        try:
            decode_image(first, self.path, self._rotation)
        except BrokenImageError:
            return True  # that one is left out
        # a CompressedImage has no size
        return bool(self._rotation) or getattr(content_of(first, self.path), "height", 0) != IMAGE_SHAPE[0]

    def pose_missing(self, base: str, gel: str) -> str:
        """Return in words, with the fix, why the recording has no pose of the frame `gel` in `base`; empty if it has.

        Of a bag, the beginning is looked at.
        """
        if self._is_sequence:
            return ""
        tree = self.frame_tree(base, gel)
        if _linked(tree, base, gel):
            return ""
        links = tree.parents
        frames = f"; it has the frames {', '.join(sorted({*links, *links.values()}))}" if links else ""
        return (
            f"{self.path}: no recorded transforms lead from '{base}' to '{gel}'{frames}; so there is no pose. "
            "Publish the missing ones meanwhile (midastouch run mount), or name the frames: tf_prefix, sensor_prefix"
        )

    def frame_tree(self, base: str, gel: str) -> FrameTree:
        """Return the frames of a bag, read until two of them are linked, from the beginning only."""
        tree, until = FrameTree(), 0
        topics = {name for name, topic in self._played.items() if topic.name in _TRANSFORMS}
        for message in islice(bag_messages(self.path, topics), _FIRST) if topics else ():
            until = until or message.stamp_ns + _FIRST_NS
            if message.stamp_ns > until:
                break
            links = content_of(message, self.path).transforms
            tree.parents |= {t.child_frame_id.lstrip("/"): t.header.frame_id.lstrip("/") for t in links}
            if _linked(tree, base, gel):
                break
        return tree

    def _of_bag(self, offset_ns: int) -> Iterator[Message]:
        start = None
        for recorded in self._without_estimates(bag_messages(self.path, self._played)):
            try:
                message = self._as_sent(recorded)
            except BrokenImageError as error:
                self.images_broken += 1
                self._on_broken(str(error))
                continue
            start = message.stamp_ns + offset_ns if start is None else start
            if message.latched or message.stamp_ns >= start:
                yield message

    def _as_sent(self, message: Message) -> Message:
        if message.topic != self._image_topic or not self._converts:
            topic = self._played[message.topic]
            return dataclasses.replace(message, topic=topic.name, latched=message.latched or topic.latched)
        pixels = decode_image(message, self.path, self._rotation)
        return image_message(message.content.header, pixels, message.stamp_ns)

    def _frames_of(self, topic: str, present: list[Topic]) -> set[str]:
        """The frame of the first message on a topic, if there is one."""
        if topic not in {each.name for each in present}:
            return set()
        first = next(bag_messages(self.path, {topic}))
        with readable(self.path):
            return {first.content.header.frame_id}

    def _without_estimates(self, messages: Iterator[Message]) -> Iterator[Message]:
        """Drop the frame that a filter published: it would conflict with that of the filter that listens."""
        for message in messages:
            if self._played[message.topic].name not in _TRANSFORMS:
                yield message
                continue
            content = content_of(message, self.path)
            kept = [t for t in content.transforms if t.child_frame_id not in self._estimated]
            if len(kept) == len(content.transforms):
                yield message
            elif kept:
                content.transforms = kept
                yield Message.of(message.topic, content, message.stamp_ns, message.latched)


def _linked(tree: FrameTree, base: str, gel: str) -> bool:
    return len({tree.ancestors(frame.lstrip("/"))[-1] for frame in (base, gel)}) == 1
