"""Images and backgrounds that cannot be right are named in the diagnostics."""

from __future__ import annotations

import functools

import cv2
import numpy as np
import pytest
from perception_fakes import BACKGROUND, image_msg, touched
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger
from tdn_rig import Feed, start

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_perception.gel_texture import GelCheck
from midastouch_perception.nodes import tdn
from midastouch_perception.tdn.background_store import BackgroundStore
from midastouch_simulation.simulated_digit import PressedSensor

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]


def lit_gel(grains: int | None = None) -> np.ndarray:
    """Untouched gel (320, 240, 3) lit red from the left, green from the right, blue from below; grains of a seed."""
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    light = np.stack([90 - 40 * x, 90 + 40 * x, 80 + 20 * y], axis=-1)
    if grains is None:
        return light.astype(np.uint8)
    texture = cv2.GaussianBlur(np.random.default_rng(grains).normal(0, 1, (320, 240)), (0, 0), 1.5)
    return np.clip(np.rint(light + 2.5 * (texture / texture.std())[..., None]), 0, 255).astype(np.uint8)


@pytest.fixture
def kept(tmp_path):
    """Writes an image as the no-contact image; gives its path."""

    def keep(image: np.ndarray) -> str:
        cv2.imwrite(str(tmp_path / "background.png"), np.ascontiguousarray(image[..., ::-1]))
        return str(tmp_path / "background.png")

    return keep


def flickering(image: np.ndarray, frames: int) -> list[np.ndarray]:
    """The image so many times, no two in a row alike."""
    return [image + np.uint8(k % 3) for k in range(frames)]


def test_bad_images_are_counted_and_survived(graph, depth, background):
    start(graph, depth, background=background)
    feed, health = Feed(graph), graph.health()
    images = graph.publisher(Image, "image_raw")
    wrong_length = image_msg(touched(60), 1)
    wrong_length.height = 319
    bad = [image_msg(touched(60)[:100], 1), image_msg(np.zeros((320, 240), np.uint8), 1, "mono8"), wrong_length]
    for msg in [*bad, image_msg(touched(60), 2)]:
        images.publish(msg)
    graph.spin_until(lambda: feed.contacts)
    assert [stamp_ns(c.header.stamp) for c in feed.contacts] == [2]
    graph.spin_until(lambda: health.values.get("bad_images") == str(len(bad)))
    health.until("image_raw")


@pytest.mark.parametrize(("level", "said"), [(0, "black"), (255, "saturated (100 % of it)")])
def test_blank_images_are_neither_contact_nor_background(graph, depth, level, said):
    """To the network the light that went off is a contact as large as the gel."""
    start(graph, depth, background_frames=1)
    feed, health = Feed(graph), graph.health()
    feed.send(np.full_like(BACKGROUND, level), BACKGROUND, touched(60))
    graph.spin_until(lambda: len(feed.contacts) == 2)
    assert [(stamp_ns(c.header.stamp), c.in_contact) for c in feed.contacts] == [(2, False), (3, True)]
    health.until(f"image_raw: the image is {said}")


def with_markers(gel: np.ndarray) -> np.ndarray:
    for y in range(15, 320, 30):
        for x in range(15, 240, 30):
            cv2.circle(gel, (x, y), 4, (20, 20, 20), -1)
    return gel


@pytest.mark.parametrize(
    ("image", "said"), [(lit_gel()[::-1, ::-1], "upside down"), (with_markers(lit_gel()), "use a gel without markers")]
)
def test_a_wrong_background_is_named_at_the_start(graph, depth, kept, image, said):
    start(graph, depth, background=kept(image))
    graph.health().until(said)


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        (lambda gel: cv2.resize(np.rot90(gel), (240, 320)), ("no part of the image", "capture_background")),
        (lambda gel: gel[:, ::-1], ("mirrored left to right against the no-contact image",)),
    ],
    ids=["rotated", "mirrored"],
)
def test_images_unlike_the_background_are_reported(graph, kept, turned, said):
    """With the real network: the fit check looks at every fifth image, and five of them must have been bad."""
    start(graph, background=kept(lit_gel()))
    feed, health = Feed(graph), graph.health()
    feed.send(*flickering(turned(lit_gel()), 25))
    graph.spin_until(lambda: any(all(each in text for each in said) for text in health.warnings), f"word of {said}")


def grained_touch(grains: int, row: int) -> np.ndarray:
    """Grained gel with a contact that begins at a row."""
    y, x = np.mgrid[0:320, 0:240]
    bump = np.exp(-((x - 120) ** 2 + (y - row - 30) ** 2) / 600)
    shading = np.stack([bump * (x - 120), bump * (y - row - 30), -bump * (x - 120)], axis=-1)
    noise = np.random.default_rng(row).normal(0, 1, shading.shape)
    return np.clip(np.rint(lit_gel(grains) + 4 * shading + noise), 0, 255).astype(np.uint8)


def test_damaged_and_misplaced_images_are_counted_and_publish_nothing(graph, depth, kept):
    """Torn, rolled: what their kind is called, and what to do; the next good image counts again."""
    start(graph, depth, background=kept(lit_gel(grains=1)))
    feed, health = Feed(graph), graph.health()
    good = [grained_touch(1, 60 + 8 * k) for k in range(4)]
    torn = np.concatenate([good[2][:110], grained_touch(1, 100)[110:]])
    feed.send(good[0], good[1], torn, good[3])
    graph.spin_until(lambda: len(feed.contacts) == 3)
    assert [stamp_ns(c.header.stamp) for c in feed.contacts] == [1, 2, 4]
    graph.spin_until(lambda: health.values.get("torn_images") == "1")
    health.until("USB port")

    feed.send(*[np.roll(grained_touch(1, 60 + k), 80, axis=1) for k in range(40)])
    graph.spin_until(lambda: int(health.values.get("misplaced_images", 0)) > 5)
    heard = len(feed.contacts)
    health.until("rolled by 80 px right")
    feed.send(*[np.roll(grained_touch(1, 60 + k), 80, axis=1) for k in range(10)])
    graph.spin_until(lambda: int(health.values.get("misplaced_images", 0)) > 15)
    assert len(feed.contacts) == heard


def test_a_touched_background_is_named_until_captured_anew(graph, real, tmp_path):
    digit = PressedSensor(real, lit_gel()[None], 3e-3, np.random.default_rng(4))
    BackgroundStore(tmp_path, "D20123").save(digit.image([(120, 160, 1.6e-3)]))
    parameters = {"sensor_model": "digit_real", "serial": "D20123", "background_folder": str(tmp_path)}
    start(graph, **parameters, background_frames=4, still_threshold=20.0)
    feed, health = Feed(graph), graph.health()
    feed.send(*flickering(digit.background, 25))
    health.until("shows a touch")
    answer = graph.request(Trigger, "capture_background", Trigger.Request())
    feed.send(*flickering(digit.background, 10))
    graph.spin_until(answer.done, "the capture")
    assert answer.result().success
    health.clear()
    graph.spin_until(lambda: any(one.level == b"\x00" for one in health.statuses), "a status without alarm")


def test_a_background_of_another_gel_is_named(graph, real, kept, monkeypatch):
    """A gel was changed: the light is as it was, the grains are not."""
    monkeypatch.setattr(tdn, "GelCheck", functools.partial(GelCheck, every=1))
    rng = np.random.default_rng(4)
    digit = PressedSensor(real, lit_gel()[None], 3e-3, rng)
    own, other = (2 * cv2.GaussianBlur(rng.normal(0, 5, (320, 240, 1)), (0, 0), 1.5)[..., None] for _ in range(2))
    presses = [digit.image([(60 + 40 * k, 160, 1.0e-3)]) for k in range(4)]
    touches = [np.clip(each + own, 0, 255).astype(np.uint8) for each in presses]
    background = kept(np.clip(digit.background + other, 0, 255).astype(np.uint8))
    start(graph, sensor_model="digit_real", background=background)
    feed, health = Feed(graph), graph.health()
    for k in range(16):
        feed.touches(touches[k % 4])
    health.until("of another gel: the fine texture")


def test_two_publishers_of_the_images_are_named(graph, depth, background):
    """Two drivers that were started by mistake, or a bag beside a live camera."""
    start(graph, depth, background=background)
    health = graph.health()
    for name in ("digit_driver", "replay"):
        assert health.warnings == []
        graph.add(Node, node_name=name, namespace="cell").create_publisher(Image, "/image_raw", qos.stream_publisher())
    graph.spin_until(lambda: health.warnings)
    assert all(name in health.warnings[0] for name in ("/image_raw", "/cell/digit_driver", "/cell/replay"))


def test_a_calibration_is_refused_once_images_show_another_gel(graph, kept, calibrated, tmp_path, monkeypatch):
    monkeypatch.setattr(tdn, "GelCheck", functools.partial(GelCheck, every=1, window=8))
    former, present = lit_gel(grains=1), lit_gel(grains=2)
    calibrated(np.zeros((12, 6, 2)), former).save(BackgroundStore(tmp_path, "D20123").calibration_path)
    start(graph, background=kept(former), background_folder=str(tmp_path), serial="D20123", sensor_model="digit_real")
    feed, health = Feed(graph), graph.health()
    for gel, in_use in ((former, "10 presses"), (present, "refused")):
        for k in range(8):
            image = gel.astype(float)
            image[100 + 10 * k : 150 + 10 * k, 80:130] *= (1.5, 0.7, 1.2)
            feed.touches(np.clip(image, 0, 255).astype(np.uint8))
        graph.spin_until(lambda in_use=in_use: health.values.get("calibration", "").startswith(in_use), in_use)
    health.until("of another gel")
