from __future__ import annotations

import numpy as np
import pytest
from perception_fakes import BACKGROUND, FakeDepthStage, FakeTcn, touched
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from tdn_rig import REPLAY

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros.conversions import points_to_msg, stamp_from_ns
from midastouch_msgs.msg import TactileCode
from midastouch_perception.contact import Contact
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds
SENSOR = SensorModel.load("digit_tacto").scaled(0.5)


def penetration_of(pixels: np.ndarray) -> np.ndarray:
    return FakeDepthStage().process(pixels, BACKGROUND).penetration


def cloud(penetration: np.ndarray, stamp: int) -> PointCloud2:
    header = Header(stamp=stamp_from_ns(stamp), frame_id="digit_gel_frame")
    return points_to_msg(cloud_from_penetration(penetration, penetration > 0, SENSOR), header)


def test_every_cloud_yields_a_code_of_its_stamp(graph):
    tcn = FakeTcn()
    graph.add(lambda **options: TcnNode(tcn=tcn, **options), REPLAY)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    codes = graph.listen(TactileCode, "tactile/code")
    maps = [np.zeros((160, 120), np.float32), penetration_of(touched(60)), penetration_of(touched(100))]
    for stamp, penetration in enumerate(maps):
        clouds.publish(cloud(penetration, stamp + 1))
    graph.spin_until(lambda: len(codes) == 3)
    assert [stamp_ns(c.header.stamp) for c in codes] == [1, 2, 3]
    assert [c.in_contact for c in codes] == [False, True, True]
    assert {(c.header.frame_id, c.network_id) for c in codes} == {("digit_gel_frame", tcn.network_id)}
    assert len(codes[0].code) == 0
    assert codes[0].contact_area == 0
    for code, penetration in zip(codes[1:], maps[1:], strict=True):
        np.testing.assert_array_equal(np.array(code.code, np.float32), tcn.encode(penetration))
        expected = np.count_nonzero(penetration) * SENSOR.pixel_area
        assert code.contact_area == pytest.approx(expected, rel=1e-6)


@pytest.mark.usefixtures("brisk_health")
def test_bad_clouds_are_counted_and_survived(graph):
    graph.add(lambda **options: TcnNode(tcn=FakeTcn(), **options), REPLAY)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    codes = graph.listen(TactileCode, "tactile/code")
    health = graph.health()
    not_finite = points_to_msg(np.full((3, 3), np.nan), Header())
    for msg in (PointCloud2(), not_finite, cloud(penetration_of(touched(60)), 5)):
        clouds.publish(msg)
    graph.spin_until(lambda: codes)
    assert [stamp_ns(c.header.stamp) for c in codes] == [5]
    graph.spin_until(lambda: health.values.get("bad_clouds") == "2")


def test_a_contact_handed_over_gives_the_code_of_its_cloud(graph):
    handed = []
    node = graph.add(
        lambda **options: TcnNode(tcn=FakeTcn(), sink=lambda *f: handed.append(f), subscribe=False, **options), REPLAY
    )
    codes = graph.listen(TactileCode, "tactile/code")
    contact = Contact.of(penetration_of(touched(60)), SENSOR)
    header = Header(stamp=stamp_from_ns(3), frame_id="digit_gel_frame")
    node.on_contact(header, contact)
    graph.spin_until(lambda: codes)
    assert codes[0].header == header
    (sent_header, touch), *_ = handed
    assert sent_header == header
    np.testing.assert_array_equal(touch.code, np.array(codes[0].code, np.float32))
    assert touch.contact is contact
