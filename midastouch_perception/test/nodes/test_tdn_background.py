"""A captured background outlives the node, per sensor."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import tdn_rig
from perception_fakes import BACKGROUND, FakeDepthStage, image_msg
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns
from midastouch_msgs.msg import TactileContact

pytestmark = pytest.mark.dds
DIMMED = BACKGROUND - 20


def start(graph, **parameters) -> None:
    tdn_rig.start(graph, FakeDepthStage(), background_frames=5, **parameters)


def capture(graph, pixels: np.ndarray) -> Trigger.Response:
    """Call the service while images come, one at a time."""
    images, contacts = graph.publisher(Image, "image_raw"), graph.listen(TactileContact, "tactile/contact")
    client = graph.companion.create_client(Trigger, "capture_background")
    graph.spin_until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    while not answer.done():
        before = len(contacts)
        images.publish(image_msg(pixels, before + 1))
        graph.spin_until(lambda before=before: len(contacts) > before or answer.done())
    return answer.result()


def in_contact(graph, pixels: np.ndarray) -> bool:
    images, contacts = graph.publisher(Image, "image_raw"), graph.listen(TactileContact, "tactile/contact")
    images.publish(image_msg(pixels, 10**9))
    graph.spin_until(lambda: contacts and stamp_ns(contacts[-1].header.stamp) == 10**9)
    return contacts[-1].in_contact


def test_it_is_used_again_by_the_next_node_of_that_sensor(graph, tmp_path):
    start(graph, serial="D20001", background_folder=str(tmp_path))
    answer = capture(graph, DIMMED)
    assert (answer.success, answer.message) == (True, f"kept in {tmp_path}/D20001.png")
    graph.remove_all()
    start(graph, serial="D20001", background_folder=str(tmp_path))
    assert in_contact(graph, BACKGROUND)
    graph.remove_all()
    start(graph, serial="D20002", background_folder=str(tmp_path))
    assert not in_contact(graph, BACKGROUND)  # its own first image is its background


def test_the_parameter_background_goes_over_it(graph, tmp_path):
    cv2.imwrite(str(tmp_path / "given.png"), BACKGROUND)
    cv2.imwrite(str(tmp_path / "D20001.png"), DIMMED)
    start(graph, serial="D20001", background_folder=str(tmp_path), background=str(tmp_path / "given.png"))
    assert not in_contact(graph, BACKGROUND)


def test_without_a_serial_it_says_that_nothing_is_kept(graph, tmp_path):
    start(graph, background_folder=str(tmp_path))
    answer = capture(graph, DIMMED)
    assert answer.success
    assert "set the parameter serial" in answer.message
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_kept_is_used_all_the_same(graph, tmp_path):
    (tmp_path / "file").touch()
    start(graph, serial="D20001", background_folder=str(tmp_path / "file"))
    answer = capture(graph, DIMMED)
    assert answer.success
    assert "in use, but" in answer.message
    assert in_contact(graph, BACKGROUND)


def test_a_serial_that_is_none_ends_the_node_at_its_start(graph):
    with pytest.raises(InputError, match="not a serial number"):
        start(graph, serial="../D20001")
