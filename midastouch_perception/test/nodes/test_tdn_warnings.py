"""Images and backgrounds that cannot be right are named in the diagnostics."""

from __future__ import annotations

import functools

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from perception_fakes import BACKGROUND, image_msg, touched
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger
from tdn_rig import REPLAY, start, warnings_of

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_msgs.msg import TactileContact
from midastouch_perception.gel_texture import GelCheck
from midastouch_perception.nodes import tdn
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.background_store import BackgroundStore
from midastouch_simulation.simulated_digit import PressedSensor

pytestmark = [pytest.mark.dds, pytest.mark.usefixtures("brisk_health")]


def test_bad_images_are_counted_and_survived(graph, depth, background):
    start(graph, depth, background=background)
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    statuses = graph.listen(DiagnosticArray, "/diagnostics")
    wrong_length = image_msg(touched(60), 1)
    wrong_length.height = 319
    deep = image_msg(touched(60), 1)
    deep.encoding, deep.step = "rgb16", 2 * deep.step
    bad = [
        image_msg(touched(60)[:100], 1),
        image_msg(np.ascontiguousarray(touched(60).transpose(1, 0, 2)), 1),
        image_msg(np.zeros((320, 240), np.uint8), 1, "mono8"),
        image_msg(np.full((320, 240), np.nan, np.float32), 1, "32FC1"),
        wrong_length,
        deep,
        Image(),
    ]
    for msg in bad:
        images.publish(msg)
    images.publish(image_msg(touched(60), 2))
    graph.spin_until(lambda: contacts)
    assert [stamp_ns(c.header.stamp) for c in contacts] == [2]

    def counted():
        return {v.key: v.value for m in statuses for s in m.status for v in s.values}.get("bad_images")

    graph.spin_until(lambda: counted() == str(len(bad)))
    assert any("image_raw" in s.message for m in statuses for s in m.status)


@pytest.mark.parametrize(("level", "said"), [(0, "black"), (255, "saturated (100 % of it)")])
def test_blank_images_are_neither_contact_nor_background(graph, depth, level, said):
    """To the network the light that went off is a contact as large as the gel."""
    start(graph, depth, background_frames=1)
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    warned = warnings_of(graph)
    for stamp, pixels in enumerate([np.full_like(BACKGROUND, level), BACKGROUND, touched(60)]):
        images.publish(image_msg(pixels, stamp + 1))
    graph.spin_until(lambda: len(contacts) == 2)
    assert [(stamp_ns(c.header.stamp), c.in_contact) for c in contacts] == [(2, False), (3, True)]
    graph.spin_until(lambda: warned())
    assert f"image_raw: the image is {said}" in warned()[0]


def lit_gel() -> np.ndarray:
    """Untouched gel (320, 240, 3) lit red from the left, green from the right, blue from below."""
    y, x = np.mgrid[-1:1:320j, -1:1:240j]
    return np.stack([90 - 40 * x, 90 + 40 * x, 80 + 20 * y], axis=-1).astype(np.uint8)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda image: image[::-1, ::-1], "upside down"),
        (lambda image: image // 20, "black"),
        (lambda image: np.full_like(image, 255), "saturated"),
    ],
)
def test_a_wrong_background_is_named_in_the_diagnostics(graph, depth, tmp_path, wrong, said):
    cv2.imwrite(str(tmp_path / "background.png"), np.ascontiguousarray(wrong(lit_gel())[:, :, ::-1]))
    start(graph, depth, background=str(tmp_path / "background.png"))
    warned = warnings_of(graph)
    graph.spin_until(lambda: warned())
    assert said in warned()[0]


def test_images_unlike_the_background_are_reported(graph, tmp_path):
    """With the real network: the fit check looks at every fifth image, and five of them must have been bad."""
    path = tmp_path / "background.png"
    cv2.imwrite(str(path), lit_gel()[:, :, ::-1])
    other = cv2.resize(np.rot90(lit_gel()), (240, 320))
    graph.add(TdnNode, {**REPLAY, "background": str(path)})
    images, warned = graph.publisher(Image, "image_raw"), warnings_of(graph)
    for stamp in range(25):
        images.publish(image_msg(other + np.uint8(stamp % 3), stamp + 1))
    graph.spin_until(lambda: warned())
    assert "no part of the image" in warned()[0]
    assert "capture_background" in warned()[0]


def test_a_touched_background_is_named_until_captured_anew(graph, tmp_path):
    real = SensorModel.load("digit_real")
    digit = PressedSensor(real, lit_gel()[None], 3e-3, np.random.default_rng(4))
    BackgroundStore(tmp_path, "D20123").save(digit.image([(120, 160, 1.6e-3)]))
    parameters = {"sensor_model": "digit_real", "serial": "D20123", "background_folder": str(tmp_path)}
    graph.add(TdnNode, {**REPLAY, **parameters, "background_frames": 4, "still_threshold": 20.0})
    images, warned = graph.publisher(Image, "image_raw"), warnings_of(graph)
    free = digit.background

    def show(stamp: int) -> None:
        images.publish(image_msg(free + np.uint8(stamp % 3), stamp))

    for stamp in range(1, 26):
        show(stamp)
    graph.spin_until(lambda: any("shows a touch" in text for text in warned()), "the alarm")
    captured = graph.companion.create_client(Trigger, "capture_background")
    graph.spin_until(captured.service_is_ready)
    answer = captured.call_async(Trigger.Request())
    for stamp in range(26, 36):
        show(stamp)
    graph.spin_until(answer.done, "the capture")
    assert answer.result().success
    statuses = graph.listen(DiagnosticArray, "/diagnostics")
    graph.spin_until(lambda: any(s.level == b"\x00" for m in statuses for s in m.status), "a status without alarm")


def test_a_background_of_another_gel_is_named_in_the_diagnostics(graph, tmp_path):
    """A gel was changed: the light is as it was, the grains are not. Of 301 images of touches 16 are compared."""
    rng = np.random.default_rng(4)
    digit = PressedSensor(SensorModel.load("digit_real"), lit_gel()[None], 3e-3, rng)
    own, other = (2 * cv2.GaussianBlur(rng.normal(0, 5, (320, 240, 1)), (0, 0), 1.5)[..., None] for _ in range(2))
    path = tmp_path / "background.png"
    cv2.imwrite(str(path), np.clip(digit.background + other, 0, 255).astype(np.uint8)[:, :, ::-1])
    presses = [digit.image([(60 + 40 * k, 160, 1.0e-3)]) for k in range(4)]
    touches = [np.clip(each + own, 0, 255).astype(np.uint8) for each in presses]
    graph.add(TdnNode, {**REPLAY, "sensor_model": "digit_real", "background": str(path)})
    images, contacts = graph.publisher(Image, "image_raw"), graph.listen(TactileContact, "tactile/contact")
    warned = warnings_of(graph)
    for stamp in range(301):
        images.publish(image_msg(touches[stamp % 4], stamp + 1))
        graph.spin_until(lambda stamp=stamp: len(contacts) > stamp)
    graph.spin_until(lambda: any("of another gel: the fine texture" in text for text in warned()), "the alarm")


def test_images_mirrored_since_the_background_are_reported(graph, tmp_path):
    path = tmp_path / "background.png"
    cv2.imwrite(str(path), lit_gel()[:, :, ::-1])
    graph.add(TdnNode, {**REPLAY, "background": str(path)})
    images, warned = graph.publisher(Image, "image_raw"), warnings_of(graph)
    for stamp in range(25):
        images.publish(image_msg(lit_gel()[:, ::-1] + np.uint8(stamp % 3), stamp + 1))
    graph.spin_until(lambda: any("against" in text for text in warned()))
    assert "look mirrored left to right against the no-contact image" in next(t for t in warned() if "against" in t)


def test_two_publishers_of_the_images_are_named(graph, depth, background):
    """Two drivers that were started by mistake, or a bag beside a live camera."""
    start(graph, depth, background=background)
    warned = warnings_of(graph)
    for name in ("digit_driver", "replay"):
        assert warned() == []
        graph.add(Node, node_name=name, namespace="cell").create_publisher(Image, "/image_raw", qos.stream_publisher())
    graph.spin_until(lambda: warned())
    assert all(name in warned()[0] for name in ("/image_raw", "/cell/digit_driver", "/cell/replay"))


def grained_gel(seed: int) -> np.ndarray:
    """A gel of its own (320, 240, 3), lit as every other one."""
    grains = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (320, 240)), (0, 0), 1.5)
    return np.clip(np.rint(lit_gel() + 2.5 * (grains / grains.std())[..., None]), 0, 255).astype(np.uint8)


def test_a_calibration_is_refused_once_images_show_another_gel(graph, tmp_path, monkeypatch):
    monkeypatch.setattr(tdn, "GelCheck", functools.partial(GelCheck, every=1, window=8))
    former, present, real = grained_gel(1), grained_gel(2), SensorModel.load("digit_real")
    cv2.imwrite(str(tmp_path / "former.png"), former[..., ::-1])
    colours, date = background_colours(former), "2026-11-22T09:00:00+00:00"
    calibration = SensorCalibration("D1", 6e-3, "digit_real", real.pixel_size, np.zeros((12, 6, 2)), colours, 10, date)
    calibration.save(BackgroundStore(tmp_path, "D1").calibration_path)
    parameters = {"background": str(tmp_path / "former.png"), "background_folder": str(tmp_path), "serial": "D1"}
    graph.add(TdnNode, REPLAY | parameters | {"sensor_model": "digit_real"})
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    statuses = graph.listen(DiagnosticArray, "/diagnostics")

    def calibrations():
        return [v.value for m in statuses for s in m.status for v in s.values if v.key == "calibration"]

    def show(gel: np.ndarray) -> None:
        for k in range(8):
            image = gel.astype(float)
            image[100 + 10 * k : 150 + 10 * k, 80:130] *= (1.5, 0.7, 1.2)
            images.publish(image_msg(np.clip(image, 0, 255).astype(np.uint8), len(contacts) + 1))
            heard = len(contacts)
            graph.spin_until(lambda heard=heard: len(contacts) > heard)
        statuses.clear()

    show(former)
    graph.spin_until(lambda: calibrations() and calibrations()[-1].startswith("10 presses"))
    show(present)
    graph.spin_until(lambda: calibrations() and calibrations()[-1] == "refused")
    assert any("of another gel" in s.message for m in statuses for s in m.status)
