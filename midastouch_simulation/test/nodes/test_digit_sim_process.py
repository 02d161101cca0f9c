"""The simulated sensor as a process of its own."""

import cv2
import numpy as np
import pytest
from engine import PERIOD, Engine, penetration
from process_rig import processes
from sensor_msgs.msg import Image

from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import rgb_from_msg, stamp_ns
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.slide import simulate_slide

pytestmark = pytest.mark.dds


@pytest.mark.slow
def test_over_dds_the_depth_network_measures_what_is_simulated(graph, tmp_path):
    """Engine and `tdn` here, the simulator in a process of its own."""
    sensor, mesh = SensorModel.load("digit_tacto"), ObjectMesh.load(bundled_objects()["handle_tool"])
    rng = np.random.default_rng(8)
    background = str(tmp_path / "background.png")
    cv2.imwrite(background, no_contact_image(sensor, rng)[..., ::-1])
    poses = simulate_slide(mesh, sensor, 0.03, rng)
    own = {"mesh": str(mesh.path), "background": background, "seed": 3}
    reliable = {"background": background, "queue_depth": 100, "reliable": True}
    graph.add(TdnNode, reliable)
    with processes({"digit_sim": ["-m", "midastouch_simulation.nodes.digit_sim"]}, {"digit_sim": own}, tmp_path):
        images = graph.listen(Image, "image_raw")
        measured, true = graph.listen(Image, "tactile/penetration"), graph.listen(Image, "ground_truth/penetration")
        count = graph.companion.count_subscribers
        graph.spin_until(lambda: count("/tf") > 0 and count("/image_raw") > 1, "the processes to find each other")
        engine = Engine(graph)
        engine.place(poses[0])
        graph.spin_until(lambda: measured and true, "the first image to be felt")
        for i, pose in enumerate(poses[1:], 1):
            engine.place(pose, PERIOD)
            graph.spin_until(lambda wanted=i: len(measured) > wanted and len(true) > wanted, f"image {i}")
    assert [stamp_ns(m.header.stamp) for m in measured] == [stamp_ns(m.header.stamp) for m in true]
    assert rgb_from_msg(images[0], 320, 240).std() > 0
    maps = [np.stack([penetration(m) for m in messages]) for messages in (measured, true)]
    assert (maps[1].max(axis=(1, 2)) > 1e-4).all()
    assert np.sqrt(np.mean((maps[0] - maps[1]) ** 2)) < 0.35 * np.sqrt(np.mean(maps[1] ** 2))
