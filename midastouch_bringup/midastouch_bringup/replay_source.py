"""What a replay sends: the messages of a sequence, or of a bag without what a filter had added to it."""

from __future__ import annotations

import dataclasses
import heapq
from collections.abc import Collection, Iterator
from pathlib import Path

from .bags import bag_messages, is_bag
from .datasets import load_sequence
from .messages import (
    CAMERA_INFO_TOPIC,
    IMAGE_TOPIC,
    TF_STATIC_TOPIC,
    TF_TOPIC,
    Message,
    sequence_messages,
    typestore,
)

INPUT_TOPICS = frozenset(
    {IMAGE_TOPIC, f"{IMAGE_TOPIC}/compressed", CAMERA_INFO_TOPIC, TF_TOPIC, TF_STATIC_TOPIC, "/joint_states"}
)
"""Topics of a bag that are inputs of the pipeline, not its results."""

ESTIMATED_FRAMES = frozenset({"object"})
"""Frames that a filter publishes: from a bag they would fight with those of the filter that listens."""


def is_image(message: Message) -> bool:
    """Whether the message ends a frame."""
    return message.topic.startswith(IMAGE_TOPIC)


def replay_messages(
    path: str | Path, topics: Collection[str] = INPUT_TOPICS, lead_ns: int = 0
) -> Iterator[Message]:
    """Messages of the sequence or bag at `path` in the order in which a replay sends them.

    `lead_ns` sends what is no image this much earlier, relative to the images of a bag. A replay that waits
    for every image's result needs it: the transform after an image must go out before its result can come.
    Raises InputError if `path` is neither or cannot be read.
    """
    if not is_bag(path):
        yield from sequence_messages(load_sequence(path))
        return
    if lead_ns == 0:
        yield from _without_estimates(bag_messages(path, topics))
        return
    # Two passes over the file: one reader cannot be at two places.
    images = (message for message in bag_messages(path, topics) if is_image(message))
    others = (message for message in bag_messages(path, topics) if not is_image(message))
    yield from heapq.merge(
        _without_estimates(others),
        images,
        key=lambda message: message.stamp_ns + (lead_ns if is_image(message) else 0),
    )


def _without_estimates(messages: Iterator[Message]) -> Iterator[Message]:
    store = typestore()
    for message in messages:
        if message.topic not in (TF_TOPIC, TF_STATIC_TOPIC):
            yield message
            continue
        content = store.deserialize_cdr(message.data, message.type_name)
        kept = [t for t in content.transforms if t.child_frame_id not in ESTIMATED_FRAMES]
        if len(kept) == len(content.transforms):
            yield message
        elif kept:
            content.transforms = kept
            data = bytes(store.serialize_cdr(content, message.type_name))
            yield dataclasses.replace(message, data=data)
