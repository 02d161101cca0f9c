"""The RViz views and the Foxglove layout against the nodes' topics and QoS. No window is opened here."""

import json
import math
import re
from pathlib import Path

import pytest
import yaml

from midastouch_common.frames import TRUTH_FRAME
from midastouch_tools import cli
from midastouch_tools.ros.launch_file import SHARE, values

PACKAGE = Path(__file__).parents[1]
VIEWS = {
    name: yaml.safe_load((PACKAGE / "rviz" / f"{name}.rviz").read_text())["Visualization Manager"]
    for name in ("midastouch", "explore")
}
VIEW = VIEWS["midastouch"]
LAYOUT = json.loads((PACKAGE / "foxglove" / "midastouch.json").read_text())
EXPLORER = "".join(
    path.read_text().replace('"~/', '"explorer/')
    for package, part in (("midastouch_motion", "explorer"), ("midastouch_simulation", "simulated_finger"))
    for path in (PACKAGE.parent / package / package / "nodes").glob(f"{part}*.py")
)
SOURCES = EXPLORER + "".join(
    path.read_text()
    for package in ("midastouch_perception", "midastouch_filter", "digit_driver")
    for path in (PACKAGE.parent / package / package / "nodes").glob("*.py")
)
PUBLISHED = {topic: kind for kind, topic in re.findall(r'create_publisher\(\s*(\w+), "([\w/]+)"', SOURCES)}
LATCHED = {
    topic
    for topic, profile in re.findall(r'create_publisher\(\s*\w+, "([\w/]+)", ([\w.]+)', SOURCES)
    if "latched" in profile
}
MESSAGE_OF = {
    "Image": "Image",
    "MarkerArray": "MarkerArray",
    "PointCloud2": "PointCloud2",
    "PoseArray": "PoseArray",
    "PoseWithCovariance": "PoseWithCovarianceStamped",
}


def displays(view):
    return {one["Topic"]["Value"]: one for one in VIEWS[view]["Displays"] if "Topic" in one}


DISPLAYS = displays("midastouch")
EVERY_DISPLAY = [(view, topic) for view in VIEWS for topic in displays(view)]


def test_everything_worth_seeing_is_shown():
    assert set(DISPLAYS) == {
        "object_mesh",
        "particles",
        "particles/cloud",
        "hypotheses",
        "pose",
        "tactile/points",
        "tactile/penetration",
        "image_raw",
    }
    assert any(one["Class"] == "rviz_default_plugins/TF" for one in VIEW["Displays"])


@pytest.mark.parametrize(("view", "topic"), EVERY_DISPLAY)
def test_topics_are_published_with_the_message_the_display_reads(view, topic):
    assert PUBLISHED[topic] == MESSAGE_OF[displays(view)[topic]["Class"].rpartition("/")[2]]


@pytest.mark.parametrize(("view", "topic"), EVERY_DISPLAY)
def test_latched_topics_are_read_as_such(view, topic):
    """A volatile display misses what was published before it opened; the reverse never connects."""
    wanted = "Transient Local" if topic in LATCHED else "Volatile"
    assert displays(view)[topic]["Topic"]["Durability Policy"] == wanted


def test_the_mesh_and_the_pose_are_latched():
    assert {"object_mesh", "pose"} <= LATCHED


def test_particles_stand_still_in_the_objects_frame():
    assert VIEW["Global Options"]["Fixed Frame"] == "object"


def test_the_cloud_is_coloured_by_a_field_it_has():
    display = DISPLAYS["particles/cloud"]
    assert display["Color Transformer"] == "Intensity"
    assert f"{display['Channel Name']}=" in SOURCES


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_names_are_unique(view):
    names = [one["Name"] for one in view["Displays"]]
    assert len(set(names)) == len(names)


class TestOfAnExploration:
    """Where a person drags the finger over the object that is really there."""

    VIEW = VIEWS["explore"]

    def test_it_is_the_one_of_the_launch_file(self):
        assert values("explore", [])["rviz_config"] == str(SHARE / "rviz" / "explore.rviz")

    def test_the_object_really_is_where_the_finger_is_shown(self):
        assert self.VIEW["Global Options"]["Fixed Frame"] == TRUTH_FRAME
        assert {"explorer/object_mesh", "object_mesh", "suggestions", "image_raw"} <= set(displays("explore"))

    def test_the_finger_is_an_interactive_marker_of_the_explorer(self):
        (finger,) = (one for one in self.VIEW["Displays"] if one["Class"] == "rviz_default_plugins/InteractiveMarkers")
        assert PUBLISHED[f"{finger['Interactive Markers Namespace']}/update"] == "InteractiveMarkerUpdate"

    def test_the_mouse_drags_at_first_and_a_tool_clicks_the_object(self):
        drag, click, *_ = self.VIEW["Tools"]
        assert drag["Class"] == "rviz_default_plugins/Interact"
        assert click["Class"] == "rviz_default_plugins/PublishPoint"
        assert f'PointStamped, "{click["Topic"]["Value"]}"' in EXPLORER


def test_the_pose_tool_speaks_of_an_object_not_of_a_room():
    (tool,) = (one for one in VIEW["Tools"] if one["Class"] == "rviz_default_plugins/SetInitialPose")
    assert 0.005 <= math.sqrt(tool["Covariance x"]) <= 0.05
    assert math.radians(10) <= math.sqrt(tool["Covariance yaw"]) <= math.radians(60)
    assert tool["Topic"]["Value"] == "initialpose"


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_the_view_starts_at_the_distance_of_an_object(view):
    assert view["Views"]["Current"]["Distance"] <= 1.0


def test_foxglove_panels_are_laid_out_and_read_topics_that_exist():
    panels = LAYOUT["configById"]

    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(LAYOUT["layout"])) == sorted(panels)
    known = {f"/{topic}" for topic in PUBLISHED} | {"/initialpose"}
    topics = layout_topics(LAYOUT)
    assert topics
    assert topics <= known


def layout_topics(layout):
    return set(re.findall(r'"(/[a-z][a-z_]*(?:/[a-z_]+)*)[".]', json.dumps(layout)))


@pytest.mark.parametrize("namespace", ["left", "/left/"])
def test_the_foxglove_layout_of_a_namespace_reads_its_topics(namespace, tmp_path):
    assert cli.main(["foxglove", "--namespace", namespace, "--out", str(tmp_path / "left.json")]) == 0
    layout = json.loads((tmp_path / "left.json").read_text())
    assert layout_topics(layout) == {f"/left{topic}" for topic in layout_topics(LAYOUT)}
    assert layout["layout"] == LAYOUT["layout"]
    assert layout["configById"]["3D!object"]["followTf"] == "object"


def test_foxglove_without_a_namespace_writes_the_shipped_layout(tmp_path):
    assert cli.main(["foxglove", "--out", str(tmp_path / "layout.json")]) == 0
    assert json.loads((tmp_path / "layout.json").read_text()) == LAYOUT
