"""The filter with and without a budget over one slide, and from where on either knows."""

import pytest

from midastouch_benchmark.statistics.exploring import summarise_observing
from midastouch_benchmark.tables.exploring import observing_table
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.observed_slides import EVIDENCE, Answer, ObservedPlan, chosen_observed, found_out
from midastouch_benchmark.trials.trial import Event
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.objects import bundled_objects
from midastouch_tools.jobs import Workers


def answers(*rows: tuple[int, float, bool]) -> list[Answer]:
    """Of (frame, probability, right); a millimetre a frame, and sure from 0.99 on."""
    return [Answer(frame, 1e-3 * frame, probability, probability >= 0.99, right) for frame, probability, right in rows]


def test_it_is_known_from_where_it_stays_sure_and_right():
    said = answers((0, 0.5, True), (8, 0.995, True), (16, 0.995, False), (24, 0.995, True), (32, 1.0, True))
    found = found_out(said, None)
    assert (found["known_frame"], found["known_m"]) == (24, 0.024)
    assert (found["sure"], found["sure_right"]) == (4, 3)
    assert found["known_soon"] is None
    assert found_out([*said, *answers((40, 0.9, True))], None)["known_m"] is None
    assert found_out([], None)["known_m"] is None


def test_an_event_ends_what_was_known():
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

    observer = found(own) | {"answers": {"probability": [0.5, 1.0], "right": [True, own is not None]}}
    return {"object": name, "slide": 0, "filter": found(its), "observers": {"maps": observer}}


def test_the_filter_is_compared_where_the_observer_knows():
    trials = [trial("a", 0.1, 0.2), trial("b", 0.0, 0.03), trial("c", 0.2, None), trial("d", None, 0.1)]
    one = summarise_observing(trials, ("maps",), 0.01)["maps"]
    assert one["known"]["share"] == one["filter_known"]["share"] == 0.75
    assert one["only_observer"]["share"] == one["only_filter"]["share"] == 0.25
    assert one["path_ratio"]["value"] == pytest.approx(3.0)  # of 2, 3 and never
    assert one["sure_right"]["share"] == pytest.approx(3 / 8)
    assert one["soon"]["share"] is None


def test_the_table_has_a_dash_where_nothing_happened_on_the_way():
    trials = [trial(str(k), 0.1, 0.2) for k in range(100)]
    (row,) = observing_table({"ideal_observer": summarise_observing(trials, ("maps",), 0.01)}).to_dict("records")
    assert row["compared by"] == "penetration maps"
    assert row["observer's path, median"].startswith("100 mm")
    assert row["known again after 20 frames"] == "-"
    kidnapped = [trial(str(k), 0.1, 0.2, soon=True) for k in range(100)]
    (row,) = observing_table({"ideal_observer": summarise_observing(kidnapped, ("maps",), 0.01)}).to_dict("records")
    assert row["known again after 20 frames"].startswith("100 %")


def test_the_observer_is_the_filter_without_a_budget(tmp_path):
    plan = ObservedPlan(Cache(tmp_path, codebook_size=50_000), FilterConfig(hysteresis=1.2))
    maps, codes = map(plan.observer, EVIDENCE)
    assert (maps.alignments_per_second, maps.max_particles, maps.hysteresis) == (0, 50_000, 1.2)
    assert (maps.refinement, codes.refinement) == (True, False)


def test_a_protocol_in_which_the_object_moves_is_refused():
    with pytest.raises(InputError, match="--protocol push: not one that can be observed"):
        chosen_observed("push")


@pytest.mark.slow
def test_the_same_slides_are_run_once(tmp_path):
    plan = ObservedPlan(
        Cache(tmp_path, slides=SlideKind(0.03), codebook_size=200), FilterConfig(threads=1), slides=(0,)
    )
    mesh = ObjectMesh.load(bundled_objects()["eyebolt"])

    def run():
        return plan.run([mesh], Workers())

    (found,), missing = run()
    assert not missing
    assert list(found["observers"]) == ["maps", "codes"]
    for observer in (found["filter"], *found["observers"].values()):
        reported = observer["answers"]
        assert len(reported["probability"]) == len(reported["right"]) == found["frames"]
        assert all(0 <= p <= 1 + 1e-9 for p in reported["probability"])
    assert found["filter"] != found["observers"]["maps"]
    log = (tmp_path / "observed.jsonl").read_text()
    assert run() == ([found], 0)
    assert (tmp_path / "observed.jsonl").read_text() == log
