"""A background from images: the first ones, or those that `capture_background` takes."""

from __future__ import annotations

import pytest
from perception_fakes import BACKGROUND, image_msg, touched
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger
from tdn_rig import start

from midastouch_common.message_arrays import stamp_ns
from midastouch_msgs.msg import TactileContact

pytestmark = pytest.mark.dds


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
