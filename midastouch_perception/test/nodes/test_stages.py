from __future__ import annotations

import numpy as np
from perception_fakes import BACKGROUND, FakeDepthStage, FakeTcn, touched

from midastouch_perception.contact import Contact
from midastouch_perception.nodes.stages import CodeStage, ImageStage
from midastouch_perception.nodes.steps import in_steps
from midastouch_perception.pointcloud import cloud_from_penetration, penetration_from_cloud
from midastouch_perception.sensor_model import SensorModel


def test_an_unchanged_image_reuses_the_depth():
    depth = FakeDepthStage()
    stage = ImageStage(depth)
    first = stage.process(touched(60), BACKGROUND)
    again = stage.process(touched(60), BACKGROUND)
    assert again is first
    assert depth.calls == 1
    assert stage.skipped["image_unchanged"] == 1
    stage.process(touched(62), BACKGROUND)
    stage.process(touched(62), BACKGROUND.copy())
    assert depth.calls == 3, "another image or another background is computed"


def test_no_contact_leaves_no_penetration():
    class Faint(FakeDepthStage):
        def process(self, image, background):
            penetration, contact = super().process(image, background)
            return penetration, Contact(False, contact.area_m2, contact.mask)

    depth = ImageStage(Faint()).process(touched(60), BACKGROUND)
    assert not depth.in_contact
    assert depth.area_m2 == 0
    assert not depth.penetration.any()


def test_the_way_through_a_cloud_changes_no_bit():
    sensor = SensorModel.load("digit_tacto").scaled(0.5)
    penetration = in_steps(np.random.default_rng(0).uniform(3e-5, 2e-3, (160, 120)).astype(np.float32))
    cloud = cloud_from_penetration(penetration, penetration > 0, sensor)
    restored = penetration_from_cloud(cloud, sensor)
    assert (restored != penetration).any(), "else nothing is shown"
    np.testing.assert_array_equal(in_steps(restored), penetration)


def test_code_stage_gates():
    tcn = FakeTcn()
    stage = CodeStage(tcn)
    empty = stage.process(np.zeros((160, 120), np.float32), 0.0)
    assert (empty.in_contact, len(empty.values), tcn.calls) == (False, 0, 0)
    penetration = FakeDepthStage().process(touched(60), BACKGROUND)[0]
    first = stage.process(penetration, 1e-6)
    again = stage.process(penetration.copy(), 1e-6)
    assert tcn.calls == 1
    np.testing.assert_array_equal(first.values, again.values)
    stage.process(penetration * 2, 1e-6)
    assert tcn.calls == 2
    assert stage.skipped == {"no_contact": 1, "cloud_unchanged": 1}
    assert first.network_id == tcn.network_id
