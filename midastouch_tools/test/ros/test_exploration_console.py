import pytest
import rclpy
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.message_arrays import SECOND
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_msgs.msg import ExplorerStatus, FilterStatus
from midastouch_perception.objects import bundled_objects
from midastouch_tools.ros import exploration_console
from midastouch_tools.ros.exploration_console import Console, object_answer, progress_line


def test_the_line_holds_what_one_waits_for():
    answer = object_answer({"bowl": 0.3, "mug": 0.62, "unknown": 0.08}, "")
    line = progress_line("exploring", 0.0451, 23.4, answer, "searching", "best pose 35%")
    assert line == "exploring, 45 mm, 23 s | perhaps mug | searching, best pose 35%"
    assert object_answer({"bowl": 0.05, "mug": 0.95}, "") == "mug"
    assert object_answer({"bowl": 0.4, "unknown": 0.6}, "") == "no object yet"
    assert object_answer({"bowl": 0.05, "unknown": 0.95}, "") == "none of the objects"


def test_without_probabilities_the_answer_is_the_given_object():
    assert object_answer({}, "eyebolt") == "eyebolt"
    assert object_answer({}, "") == "no object yet"


def test_the_longest_line_fits_a_hundred_columns():
    answer = object_answer({"o" * 80: 0.5}, "")
    assert len(progress_line("exploring", 99.999, 99_999, answer, "uninitialised", "best pose 100%")) <= 100


@pytest.mark.dds
def test_no_person_has_a_finger_that_has_not_begun(graph, monkeypatch):
    shown = []
    monkeypatch.setattr(exploration_console, "progress_line", lambda state, *_: shown.append(state) or "")
    graph.add(Console, mesh="mug.ply", given=True, context=rclpy.get_default_context())
    explorer = graph.publisher(ExplorerStatus, "explorer/status", latched=True)
    for number, state in enumerate(("paused", "exploring", "paused"), 1):  # it is started paused
        explorer.publish(ExplorerStatus(state=state))
        graph.spin_until(lambda number=number: len(shown) == number)
    assert shown == ["waiting", "exploring", "paused"]


@pytest.mark.dds
def test_the_time_since_the_object_changed_goes_by_answers_to_frames(graph):
    """A filter without frames stamps by the machine's clock, which a finger that waits for a slow filter is behind."""
    objects = bundled_objects()
    console = graph.add(
        Console, mesh=str(objects["eyebolt"].resolve()), given=True, context=rclpy.get_default_context()
    )
    statuses = graph.publisher(FilterStatus, "filter_status", latched=True)
    meshes = graph.publisher(MarkerArray, "explorer/object_mesh", latched=True)

    def say(*answers):
        for state, seconds in answers:
            header = Header(stamp=stamp_from_ns(round(seconds * SECOND)))
            statuses.publish(FilterStatus(header=header, state=state))

    say((FilterStatus.STATE_CONVERGED, 1.0), (FilterStatus.STATE_STALE, 9.0), (FilterStatus.STATE_LOST, 1.25))
    graph.spin_until(lambda: console.since_change_ns == SECOND // 4)
    meshes.publish(MarkerArray(markers=[Marker(action=Marker.ADD, mesh_resource=f"file://{objects['ball']}")]))
    graph.spin_until(lambda: console.mesh.endswith("ball.ply"))
    assert console.since_change_ns is None
    say(
        (FilterStatus.STATE_UNINITIALISED, 9.5),
        (FilterStatus.STATE_SEARCHING, 1.5),
        (FilterStatus.STATE_AMBIGUOUS, 2.0),
    )
    graph.spin_until(lambda: console.since_change_ns == SECOND // 2)
