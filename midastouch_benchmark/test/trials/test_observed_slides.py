"""The filter and the observer over one slide, and from where on either knows."""

import numpy as np
import pytest

from midastouch_benchmark.statistics.observing import summarise_observing
from midastouch_benchmark.tables.observing import observing_table
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.ideal_observer import Hypotheses
from midastouch_benchmark.trials.observed_slides import (
    Answer,
    ObservedPlan,
    chosen_observed,
    found_out,
    poses_left,
    run_observed,
)
from midastouch_benchmark.trials.trial import Event
from midastouch_benchmark.trials.trial_log import TrialLog, Workforce
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_bringup.cluster import open_cluster
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.objects import bundled_objects
from midastouch_perception.symmetry.group import Symmetry


def answers(*rows: tuple[int, float, bool]) -> list[Answer]:
    """Of (frame, probability, right); a millimetre a frame."""
    return [Answer(frame, 1e-3 * frame, probability, right) for frame, probability, right in rows]


def test_it_is_known_from_where_it_stays_sure_and_right():
    said = answers((0, 0.5, True), (8, 0.995, True), (16, 0.995, False), (24, 0.995, True), (32, 1.0, True))
    found = found_out(said, None)
    assert (found["known_frame"], found["known_m"]) == (24, 0.024)
    assert (found["sure"], found["sure_right"]) == (4, 3)
    assert found["known_soon"] is None
    assert found_out([*said, *answers((40, 0.9, True))], None)["known_m"] is None
    assert found_out([], None)["known_m"] is None


def test_an_event_ends_what_was_known_and_is_asked_about_20_frames_later():
    before = answers((0, 1.0, True), (10, 1.0, True))
    late = answers((30, 1.0, False), (45, 0.5, True), (55, 1.0, True), (70, 1.0, True))
    found = found_out(before + late, Event(20, 30))
    assert found["known_m"] == 0.0
    assert found["again_m"] == pytest.approx(0.025)
    assert found["known_soon"] is False
    soon = answers((30, 0.5, False), (45, 1.0, True), (55, 1.0, True))
    assert found_out(before + soon, Event(20, 30))["known_soon"] is True
    assert found_out(before + soon[:2], Event(20, 30))["known_soon"] is None  # the slide ends before


def trial(name: str, own: float | None, its: float | None, soon: bool | None = None) -> dict:
    def found(path: float | None) -> dict:
        return {"known_m": path, "again_m": path, "known_soon": soon, "sure": 2, "sure_right": int(path is not None)}

    reported = {"probability": [0.5, 1.0], "right": [True, own is not None], "true_probability": [0.1, 0.9]}
    observer = found(own) | {"answers": reported | {"credible": [9, 1]}}
    return {"object": name, "slide": 0, "filter": found(its), "observers": {"maps": observer}}


def test_the_filter_is_compared_where_the_observer_knows():
    trials = [trial("a", 0.1, 0.2), trial("b", 0.0, 0.03), trial("c", 0.2, None), trial("d", None, 0.1)]
    one = summarise_observing(trials, ("maps",), 0.01)["maps"]
    assert one["known"]["share"] == one["filter_known"]["share"] == 0.75
    assert one["only_observer"]["share"] == one["only_filter"]["share"] == 0.25
    assert one["path_ratio"]["value"] == pytest.approx(3.0)  # of 2, 3 and never
    assert one["sure_right"]["share"] == pytest.approx(3 / 8)
    assert one["soon"]["share"] is None
    assert one["truth"]["value"] == pytest.approx(0.9)


def test_the_table_has_a_dash_where_nothing_happened_on_the_way():
    trials = [trial(str(k), 0.1, 0.2) for k in range(100)]
    (row,) = observing_table(summarise_observing(trials, ("maps",), 0.01)).to_dict("records")
    assert row["compared by"] == "penetration maps"
    assert row["observer's path, median"].startswith("100 mm")
    assert row["known again after 20 frames"] == "-"
    kidnapped = [trial(str(k), 0.1, 0.2, soon=True) for k in range(100)]
    (row,) = observing_table(summarise_observing(kidnapped, ("maps",), 0.01)).to_dict("records")
    assert row["known again after 20 frames"].startswith("100 %")


def test_what_is_left_are_poses_that_are_told_apart_beside_the_truth():
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    poses = np.stack([np.eye(4), se3.translation([2e-3, 0, 0]), half_turn, np.eye(4)])
    poses[3, 1, 3] = 0.09
    some = Hypotheses(poses, np.tile(np.eye(6), (4, 1, 1)), np.log([0.5, 0.2, 0.295, 0.005]), np.zeros(4))
    truth, other = poses_left(some, np.eye(4), Yardstick())
    assert list(truth.values()) == pytest.approx([0.0, 0.0, 0.7], abs=1e-6)
    assert list(other.values()) == pytest.approx([0.0, 180.0, 0.295], abs=1e-6)
    (one,) = poses_left(some, np.eye(4), Yardstick(Symmetry(np.stack([np.eye(4), half_turn]))))
    assert one["probability"] == pytest.approx(0.995)


def test_a_protocol_in_which_the_object_moves_is_refused():
    with pytest.raises(InputError, match="--protocol push: not one that can be observed"):
        chosen_observed("push")


@pytest.mark.slow
def test_the_same_slides_are_run_once(tmp_path):
    plan = ObservedPlan(
        Cache(tmp_path, slides=SlideKind(0.03), codebook_size=200),
        FilterConfig(max_particles=500, threads=1),
        slides=(0,),
    )
    mesh = ObjectMesh.load(bundled_objects()["eyebolt"])

    def run():
        with open_cluster() as cluster:
            return run_observed(plan, [mesh], TrialLog(tmp_path / "log.jsonl"), Workforce(cluster))

    (found,), missing = run()
    assert not missing
    assert list(found["observers"]) == ["maps", "codes", "both"]
    for observer in found["observers"].values():
        reported = observer["answers"]
        assert reported["frame"][0] == 0
        assert reported["hypotheses"][0] <= 200
        assert 0.5 < sum(one["probability"] for one in observer["left"]) <= 1 + 1e-9
        assert all(0 <= p <= 1 + 1e-9 for p in reported["true_probability"])
    log = (tmp_path / "log.jsonl").read_text()
    assert run() == ([found], 0)
    assert (tmp_path / "log.jsonl").read_text() == log
