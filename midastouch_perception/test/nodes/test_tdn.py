from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger

sys.path.insert(0, str(Path(__file__).parent))

from perception_fakes import BACKGROUND, FakeDepthStage, image_msg, touched

from midastouch_msgs.msg import TactileContact
from midastouch_perception.errors import InputError
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.pointcloud import penetration_from_cloud
from midastouch_perception.ros.conversions import image_from_msg, points_from_msg, stamp_ns
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds
REPLAY = {"queue_depth": 100, "reliable": True}


@pytest.fixture
def background(tmp_path) -> str:
    path = str(tmp_path / "background.png")
    cv2.imwrite(path, BACKGROUND)
    return path


@pytest.fixture
def depth() -> FakeDepthStage:
    return FakeDepthStage()


def start(graph, depth, **parameters) -> TdnNode:
    return graph.add(lambda **options: TdnNode(depth=depth, **options), {**REPLAY, **parameters})


def test_every_image_yields_a_cloud_and_a_contact_of_its_stamp(graph, depth, background):
    start(graph, depth, background=background)
    images = graph.publisher(Image, "image_raw")
    clouds = graph.listen(PointCloud2, "tactile/points")
    contacts = graph.listen(TactileContact, "tactile/contact")
    maps = graph.listen(Image, "tactile/penetration")
    frames = [BACKGROUND, touched(60), touched(60), touched(100), BACKGROUND]
    for stamp, pixels in enumerate(frames):
        images.publish(image_msg(pixels, stamp + 1))
    graph.spin_until(lambda: len(clouds) == len(contacts) == len(maps) == 5)

    assert [stamp_ns(c.header.stamp) for c in clouds] == [1, 2, 3, 4, 5]
    assert [stamp_ns(c.header.stamp) for c in contacts] == [1, 2, 3, 4, 5]
    assert {m.header.frame_id for m in [*clouds, *contacts, *maps]} == {"digit_gel_frame"}
    assert [c.in_contact for c in contacts] == [False, True, True, True, False]
    assert [c.width > 0 for c in clouds] == [False, True, True, True, False]
    assert depth.calls == 4, "the repeated image is not computed again"
    sensor = SensorModel.load("digit_tacto").scaled(0.5)
    for cloud, sent in zip(clouds, maps, strict=True):
        assert sent.encoding == "32FC1"
        restored = penetration_from_cloud(points_from_msg(cloud), sensor)
        np.testing.assert_allclose(restored, image_from_msg(sent), atol=1e-7)
    assert contacts[1].area == pytest.approx(1e-8 * clouds[1].width)


def test_bgr_images_mean_the_same(graph, depth, background):
    start(graph, depth, background=background)
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    images.publish(image_msg(touched(60), 1))
    images.publish(image_msg(np.ascontiguousarray(touched(60)[:, :, ::-1]), 2, "bgr8"))
    graph.spin_until(lambda: len(contacts) == 2)
    assert contacts[0].area == contacts[1].area > 0


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
def test_images_that_show_nothing_are_no_contact_and_no_background(graph, depth, level, said):
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


def test_background_is_estimated_from_the_first_images(graph, depth):
    start(graph, depth, background_frames=4)
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    for stamp, pixels in enumerate([BACKGROUND] * 4 + [touched(60)]):
        images.publish(image_msg(pixels, stamp + 1))
    graph.spin_until(lambda: len(contacts) == 5)
    assert [c.in_contact for c in contacts] == [False] * 4 + [True]


def test_capture_background(graph, depth, background):
    start(graph, depth, background=background, background_frames=5)
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    client = graph.companion.create_client(Trigger, "capture_background")
    graph.spin_until(client.service_is_ready)

    def capture(frames):
        future = client.call_async(Trigger.Request())
        for pixels in frames:
            # the request and an image may overtake each other: one image at a time
            expected = len(contacts) + 1
            images.publish(image_msg(pixels, expected))
            graph.spin_until(lambda expected=expected: len(contacts) == expected)
        graph.spin_until(future.done)
        return future.result()

    moving = capture([touched(20 * i) for i in range(12)])
    assert not moving.success
    assert "not still" in moving.message

    touching = capture([touched(60)] * 12)
    assert not touching.success
    assert "lift the finger" in touching.message

    dimmed = BACKGROUND - 20
    assert capture([dimmed] * 12).success
    images.publish(image_msg(BACKGROUND, 1000))
    graph.spin_until(lambda: stamp_ns(contacts[-1].header.stamp) == 1000)
    assert contacts[-1].in_contact, "what was captured is now the background"


def test_capture_without_images_gives_up(graph, depth, background):
    start(graph, depth, background=background, capture_timeout=0.2)
    response = graph.call(Trigger, "capture_background", Trigger.Request())
    assert not response.success
    assert "0.2 s" in response.message


def test_clouds_are_not_built_for_nobody(graph, depth, background):
    handed = []
    graph.add(
        lambda **options: TdnNode(depth=depth, sink=lambda *frame: handed.append(frame), **options),
        {**REPLAY, "background": background},
    )
    statuses = graph.listen(DiagnosticArray, "/diagnostics")
    images = graph.publisher(Image, "image_raw")
    images.publish(image_msg(touched(60), 7))
    graph.spin_until(lambda: handed)
    header, depth_of_frame = handed[0]
    assert (stamp_ns(header.stamp), header.frame_id) == (7, "digit_gel_frame")
    assert depth_of_frame.in_contact
    values = {}
    graph.spin_until(
        lambda: (
            values.update((v.key, v.value) for m in statuses for s in m.status for v in s.values)
            or values.get("no_subscriber") == "1"
        )
    )


def warnings_of(graph) -> Callable[[], list[str]]:
    """Gives the messages of all statuses so far that warn."""
    warned: list[str] = []
    statuses = graph.listen(DiagnosticArray, "/diagnostics")

    def collect() -> list[str]:
        warned.extend(s.message for m in statuses for s in m.status if s.level != b"\x00")
        statuses.clear()
        return warned

    return collect


def lit_gel() -> np.ndarray:
    """Untouched gel (320, 240, 3) lit red from the left, green from the right."""
    x = np.linspace(-1, 1, 240)
    row = np.stack([90 - 40 * x, 90 + 40 * x, np.full(240, 80)], axis=1)
    return np.tile(row, (320, 1, 1)).astype(np.uint8)


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


def test_images_unlike_the_background_are_named_in_the_diagnostics(graph, background):
    """With the real network: the fit check looks at every fifth image, and five of them must have been bad."""
    graph.add(TdnNode, {**REPLAY, "background": background})
    images, warned = graph.publisher(Image, "image_raw"), warnings_of(graph)
    for stamp in range(25):
        images.publish(image_msg(BACKGROUND + np.uint8(30 + stamp), stamp + 1))
    graph.spin_until(lambda: warned())
    assert "no part of the image" in warned()[0]
    assert "capture_background" in warned()[0]


@pytest.mark.parametrize(
    "parameters", [{"background": "/nowhere.png"}, {"sensor_model": "gelsight"}, {"still_treshold": 1.0}]
)
def test_bad_parameters_fail_at_start(graph, depth, parameters):
    with pytest.raises(InputError):
        start(graph, depth, **parameters)


def test_the_shipped_network_runs_in_the_node(graph, background):
    graph.add(TdnNode, {**REPLAY, "background": background})
    images = graph.publisher(Image, "image_raw")
    contacts = graph.listen(TactileContact, "tactile/contact")
    pressed = BACKGROUND.copy()
    cv2.circle(pressed, (120, 160), 30, (150, 90, 60), -1)
    for stamp, pixels in enumerate([BACKGROUND, pressed]):
        images.publish(image_msg(pixels, stamp + 1))
    graph.spin_until(lambda: len(contacts) == 2)
    assert [c.in_contact for c in contacts] == [False, True]
