import cv2
import numpy as np
import pytest
from engine import PERIOD, Engine, penetration
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from digit_driver.nodes.image_publisher import IMAGE_QOS
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import stamp_ns
from midastouch_msgs.msg import TactileContact
from midastouch_msgs.srv import SetObject
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.nodes.digit_sim import DigitSim

pytestmark = pytest.mark.dds
BALL = str(bundled_objects()["ball"])
RADIUS = 0.03  # m


def above(height: float) -> np.ndarray:
    """The gel over the ball's pole, its apex so far above the surface [m]."""
    pose = np.eye(4)
    pose[2, 3] = RADIUS + height
    return pose


@pytest.fixture
def engine(graph):
    """Moves a `digit_sim` over a ball, in one process."""
    graph.add(DigitSim, {"mesh": BALL, "transform_timeout": 0.3})
    return Engine(graph)


def test_topics_look_like_those_of_the_driver(graph, engine):
    images, infos = graph.listen(Image, "image_raw"), graph.listen(CameraInfo, "camera_info")
    jpegs = graph.listen(CompressedImage, "image_raw/compressed")
    engine.place(above(-1e-3))
    graph.spin_until(lambda: images and infos and jpegs, "an image on each topic")
    image, info = images[0], infos[0]
    assert {stamp_ns(m.header.stamp) for m in (image, info, jpegs[0])} == {engine.stamp}
    assert {m.header.frame_id for m in (image, info, jpegs[0])} == {"digit_optical_frame"}
    assert (image.encoding, image.height, image.width, image.step) == ("rgb8", 320, 240, 720)
    assert (info.height, info.width) == (320, 240)
    sensor = SensorModel.load("digit_tacto")
    np.testing.assert_allclose(np.reshape(info.k, (3, 3)) @ (0, 0, 1), (120, 160, 1))
    assert info.k[0] == pytest.approx(sensor.focal)
    for topic in ("image_raw", "image_raw/compressed", "camera_info"):
        (offered,) = graph.companion.get_publishers_info_by_topic(f"/{topic}")
        assert offered.qos_profile.reliability == IMAGE_QOS.reliability
        assert offered.qos_profile.durability == IMAGE_QOS.durability


def test_truth_says_what_touches(graph, engine):
    contacts = graph.listen(TactileContact, "ground_truth/contact")
    maps = graph.listen(Image, "ground_truth/penetration")
    for i, height in enumerate((2e-3, -1e-3)):
        engine.place(above(height), PERIOD)
        graph.spin_until(lambda count=i + 1: len(contacts) >= count and len(maps) >= count, "the truth of an image")
    assert [one.in_contact for one in contacts] == [False, True]
    # two caps of 30 mm and of the gel's radius that overlap by 1 mm share a circle
    gel = 0.0327684
    expected = 2 * np.pi * 1e-3 / (1 / RADIUS + 1 / gel)
    assert contacts[1].area == pytest.approx(expected, rel=0.1)
    assert penetration(maps[0]).max() == 0
    assert penetration(maps[1]).max() == pytest.approx(1e-3, abs=5e-5)
    assert maps[1].header.frame_id == contacts[1].header.frame_id == "digit_gel_frame"


def test_images_are_evenly_timed_whatever_the_engine_s_rate(graph, engine):
    images = graph.listen(Image, "image_raw")
    engine.place(above(-1e-3))
    graph.spin_until(lambda: images, "a first image")
    for wanted in (3, 6):
        engine.place(above(-1e-3), 3 * PERIOD + 1e-4)
        graph.spin_until(lambda wanted=wanted: len(images) > wanted, "the images between two states of the engine")
    steps = np.diff([stamp_ns(m.header.stamp) for m in images])
    assert set(steps) == {round(1e9 * PERIOD)}


@pytest.mark.usefixtures("brisk_health")
class TestTheEngine:
    """What goes wrong with it is said, and ends by itself."""

    def test_is_waited_for(self, graph):
        graph.add(DigitSim, {"mesh": BALL})
        status = graph.health("digit_sim").until("waiting for TF")
        assert status.level == b"\x02"
        assert "object_ground_truth" in status.message

    def test_stops_and_goes_on(self, graph, engine):
        images, health = graph.listen(Image, "image_raw"), graph.health("digit_sim")
        engine.place(above(0))
        assert health.until("TF has stopped").level == b"\x02"
        before = len(images)
        engine.place(above(0), 0.5)
        graph.spin_until(lambda: len(images) > before, "an image after the pause")

    def test_jumps_back_in_time(self, graph, engine):
        images, health = graph.listen(Image, "image_raw"), graph.health("digit_sim")
        engine.place(above(0), 60.0)
        graph.spin_until(lambda: images, "an image")
        engine.place(above(0), -50.0)
        health.until("jumped back in time")
        assert health.values["time_jumps"] == "1"
        graph.spin_until(lambda: stamp_ns(images[-1].header.stamp) == engine.stamp, "an image of the new time")

    def test_jumps_in_space(self, graph, engine):
        images, health = graph.listen(Image, "image_raw"), graph.health("digit_sim")
        engine.place(above(0))
        graph.spin_until(lambda: images, "an image")
        engine.place(above(0.4), PERIOD)
        health.until("jumped 400 mm within 17 ms")

    def test_sends_nonsense_and_pushes_the_sensor_into_the_object(self, graph, engine):
        health, nowhere = graph.health("digit_sim"), above(0)
        nowhere[0, 3] = np.nan
        engine.place(nowhere)
        health.until("/tf: transform")
        engine.place(above(-8e-3), PERIOD)
        assert health.until("8 mm in the gel").level == b"\x01"
        assert float(health.values["deepest_mm"]) == pytest.approx(8, abs=0.1)


def test_an_impossible_object_or_background_is_refused(graph, tmp_path):
    ball, path = ObjectMesh.load(BALL), tmp_path / "ball.obj"
    for scale, complaint in ((1e3, "in millimetres it is 60 mm long"), (1e-3, "0.06 mm.*in metres")):
        lines = [f"v {x} {y} {z}" for x, y, z in scale * ball.vertices]
        path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in ball.faces + 1)]))
        with pytest.raises(InputError, match=f"ball.obj.*{complaint}"):
            graph.add(DigitSim, {"mesh": str(path)})
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(InputError, match=r"small.png: 10 x 10"):
        graph.add(DigitSim, {"mesh": BALL, "background": str(tmp_path / "small.png")})


@pytest.mark.usefixtures("brisk_health")
def test_another_object_is_put_in_the_place_of_the_first(graph, engine):
    health = graph.health("digit_sim")
    contacts = graph.listen(TactileContact, "ground_truth/contact")
    engine.place(above(-1e-3))
    graph.spin_until(lambda: contacts, "the ball to be felt")
    eyebolt = str(bundled_objects()["eyebolt"])
    assert not graph.call(SetObject, "digit_sim/set_object", SetObject.Request(mesh_path="/nowhere.ply")).success
    assert graph.call(SetObject, "digit_sim/set_object", SetObject.Request(mesh_path=eyebolt)).success
    health.clear()
    health.until("TF has stopped")  # which the word that it was loading does not hide
    for _ in range(2):  # the first may still have been taken of the ball
        wanted = len(contacts) + 1
        engine.place(above(-1e-3), PERIOD)
        graph.spin_until(lambda wanted=wanted: len(contacts) >= wanted, "another image")
    # the eyebolt does not reach so far up
    assert [contacts[0].in_contact, contacts[-1].in_contact] == [True, False]
