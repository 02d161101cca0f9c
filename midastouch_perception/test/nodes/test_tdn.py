"""Images in, clouds and contacts out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from perception_fakes import BACKGROUND, image_msg, touched
from rcl_interfaces.msg import Log
from sensor_msgs.msg import Image, PointCloud2
from tdn_rig import REPLAY, Feed, start

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import image_from_msg, points_from_msg, stamp_ns
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.pointcloud import penetration_from_cloud
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds


def test_every_image_yields_a_cloud_and_a_contact_of_its_stamp(graph, depth, background):
    start(graph, depth, background=background)
    feed = Feed(graph)
    clouds, maps = graph.listen(PointCloud2, "tactile/points"), graph.listen(Image, "tactile/penetration")
    feed.send(BACKGROUND, touched(60), touched(60), touched(100), BACKGROUND)
    contacts = feed.contacts
    graph.spin_until(lambda: len(clouds) == len(contacts) == len(maps) == 5)

    assert [stamp_ns(c.header.stamp) for c in clouds] == [1, 2, 3, 4, 5]
    assert [stamp_ns(c.header.stamp) for c in contacts] == [1, 2, 3, 4, 5]
    assert {m.header.frame_id for m in [*clouds, *contacts, *maps]} == {"digit_gel_frame"}
    assert [c.in_contact for c in contacts] == [False, True, True, True, False]
    assert [c.state for c in contacts] == ["free", "contact", "contact", "contact", "free"]
    assert [c.width > 0 for c in clouds] == [False, True, True, True, False]
    sensor = SensorModel.load("digit_tacto").scaled(0.5)
    for cloud, sent in zip(clouds, maps, strict=True):
        assert sent.encoding == "32FC1"
        restored = penetration_from_cloud(points_from_msg(cloud), sensor)
        np.testing.assert_array_equal(restored, image_from_msg(sent))
    assert contacts[1].area == pytest.approx(sensor.pixel_area * clouds[1].width)


@pytest.mark.usefixtures("brisk_health")
def test_clouds_are_not_built_for_nobody(graph, depth, background):
    handed = []
    graph.add(
        lambda **options: TdnNode(depth=depth, sink=lambda *frame: handed.append(frame), **options),
        {**REPLAY, "background": background},
    )
    health = graph.health()
    graph.publisher(Image, "image_raw").publish(image_msg(touched(60), 7))
    graph.spin_until(lambda: handed)
    header, contact = handed[0]
    assert (stamp_ns(header.stamp), header.frame_id) == (7, "digit_gel_frame")
    assert contact.in_contact
    graph.spin_until(lambda: health.values.get("no_subscriber") == "1")


@pytest.mark.usefixtures("brisk_health")
def test_images_that_stay_away_are_asked_for(graph, depth, background, monkeypatch):
    monkeypatch.setattr("midastouch_perception.nodes.tdn.SILENT_S", 0.0)
    start(graph, depth, background=background)
    graph.health().until("no image on /image_raw for")


@pytest.mark.usefixtures("brisk_health")
def test_a_missing_driver_is_logged_once(graph, depth, background, monkeypatch):
    """In the diagnostics alone, who starts it at a terminal would not see it."""
    monkeypatch.setattr("midastouch_common.ros.diagnostics.LASTING_S", 0.2)
    start(graph, depth, background=background)
    logs = graph.listen(Log, "/rosout", latched=True, wanted=lambda log: "no image on" in log.msg)
    graph.spin_until(lambda: logs, "the warning")
    images, health = graph.publisher(Image, "image_raw"), graph.health()
    graph.spin_until(lambda: len(health.statuses) > 3, "the health with a publisher that sends nothing")
    assert len(logs) == 1
    images.publish(image_msg(touched(60), 7))
    graph.spin_until(lambda: len(logs) > 1, "its end")
    missing = "no image on /image_raw, so no pose: no node publishes it; start a driver or a replay"
    assert [log.msg for log in logs] == [missing, f"over: {missing}"]


@pytest.mark.parametrize("parameters", [{"background": "/nowhere.png"}, {"sensor_model": "gelsight"}])
def test_bad_parameters_fail_at_start(graph, depth, parameters):
    with pytest.raises(InputError):
        start(graph, depth, **parameters)


def test_the_shipped_network_runs_in_the_node(graph, background):
    start(graph, background=background)
    feed, pressed = Feed(graph), BACKGROUND.copy()
    cv2.circle(pressed, (120, 160), 30, (150, 90, 60), -1)
    assert [feed.touches(BACKGROUND), feed.touches(pressed)] == [False, True]
