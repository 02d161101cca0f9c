"""The mount: frames.yaml against the sensor model, the xacro against frames.yaml."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel

PACKAGE = Path(__file__).parents[1]
FRAMES = yaml.safe_load((PACKAGE / "config" / "frames.yaml").read_text())
XACRO = PACKAGE / "urdf" / "digit_mount.urdf.xacro"


def transform(name):
    """T_parent_child (4, 4), rpy about fixed axes as in URDF."""
    entry = FRAMES[name]
    return se3.make(Rotation.from_euler("xyz", entry["rpy"]).as_matrix(), np.array(entry["xyz"]))


def test_frames_form_the_documented_tree():
    edges = {(entry["parent"], entry["child"]) for entry in FRAMES.values()}
    assert edges == {("tool0", "digit_link"), ("digit_link", "digit_gel_frame"), ("digit_link", "digit_optical_frame")}


@pytest.mark.parametrize("name", ["digit_tacto", "digit_real"])
def test_camera_sees_the_gel_as_the_sensor_model_says(name):
    gel_from_optical = se3.inverse(transform("gel")) @ transform("optical")
    # z of the gel points to the camera; the optical axis points back at the apex, y down (REP 103)
    expected = se3.make(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, SensorModel.load(name).gel_distance]))
    np.testing.assert_allclose(gel_from_optical, expected, atol=1e-12)


def test_gel_normal_points_back_into_the_sensor():
    T_link_gel = transform("gel")
    np.testing.assert_allclose(T_link_gel[:3, 2], [0, 0, -1], atol=1e-12)
    assert T_link_gel[2, 3] > 0


def test_the_apex_of_the_gel_is_the_tip_of_the_drawn_housing():
    sizes = dict(re.findall(r'name="(body_depth|gel_depth)" value="([\d.]+)"', XACRO.read_text()))
    tip = float(sizes["body_depth"]) + float(sizes["gel_depth"])
    assert transform("gel")[2, 3] == pytest.approx(tip)


def test_xacro_is_well_formed_and_reads_the_frames_file():
    tag = "{http://www.ros.org/wiki/xacro}"
    root = ElementTree.parse(XACRO).getroot()
    arguments = {one.get("name"): one.get("default") for one in root.iter(f"{tag}arg")}
    assert set(arguments) == {"frames_file", "prefix", "tool_frame", "tf_prefix"}
    assert (XACRO.parent / arguments["frames_file"]).resolve() == PACKAGE / "config" / "frames.yaml"
    used = {one.get("frame") for one in root.iter(f"{tag}mounted")}
    assert used == {f"${{frames['{name}']}}" for name in FRAMES}
    assert not list(root.iter("mesh"))  # plain geometry of our own


def test_processed_urdf_is_the_tree_of_the_frames_file():
    xacro = pytest.importorskip("xacro", reason="xacro comes with a system ROS")
    mappings = {"prefix": "left_", "tf_prefix": "a_", "tool_frame": "tool0_controller"}
    root = ElementTree.fromstring(xacro.process_file(str(XACRO), mappings=mappings).toxml())
    joints = {joint.find("child").get("link"): joint for joint in root.iter("joint")}
    assert set(joints) == {f"left_{entry['child']}" for entry in FRAMES.values()}
    assert joints["left_digit_link"].find("parent").get("link") == "a_tool0_controller"
    for entry in FRAMES.values():
        origin = joints[f"left_{entry['child']}"].find("origin")
        for key in ("xyz", "rpy"):
            np.testing.assert_allclose([float(v) for v in origin.get(key).split()], entry[key])
    assert len(list(root.iter("link"))) == len(joints) + 1
