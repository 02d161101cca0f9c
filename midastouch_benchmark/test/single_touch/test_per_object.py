"""One object's figures and those of several, with codes that know the answer."""

from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_benchmark.single_touch import per_object as single_touch_object
from midastouch_benchmark.single_touch.per_object import (
    CELL_COLUMNS,
    SingleTouchPlan,
    error_by_place,
    measure_object,
    summarise_objects,
)
from midastouch_benchmark.single_touch.simulated_touch import Lighting
from midastouch_benchmark.tables.perception import single_touch_limits, single_touch_notes, single_touch_table
from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.result_file import to_json

MISSED = 7


@pytest.fixture
def measure(mesh, codebook, pose_codes, monkeypatch):
    """Function (plan) -> the object's entry; codes tell the pose."""

    class Simulator:
        def __init__(self, mesh, networks, lighting):
            pass

        def encode(self, poses, tcn, rng, progress):
            progress(len(poses))
            return pose_codes(poses), np.arange(len(poses)) >= MISSED

    monkeypatch.setattr(single_touch_object, "TouchSimulator", Simulator)

    def measure(plan: SingleTouchPlan) -> dict:
        networks = SimpleNamespace(tcn=None, sensor=SensorModel.load("digit_tacto"))
        counted = []
        result = measure_object(mesh, codebook, networks, plan, np.random.default_rng(0), counted.append)
        assert sum(counted) == plan.touches
        assert result["missed"] == MISSED
        return to_json(result)

    return measure


def test_the_errors_are_their_distribution(measure):
    result = measure(SingleTouchPlan(300, Lighting()))
    assert result["errors"] == sorted(result["errors"])
    assert result["errors"][250] == pytest.approx(result["summary"]["median"], abs=1e-3)


def test_the_cells_hold_every_touch_once(measure, mesh):
    result = measure(SingleTouchPlan(200, Lighting()))
    cells = np.array(result["cells"])
    column = {name: cells[:, k] for k, name in enumerate(CELL_COLUMNS)}
    assert column["touches"].sum() == 200
    mean = (column["error"] * column["touches"]).sum() / 200
    assert mean == pytest.approx(result["summary"]["normalised_top25_error"], abs=2e-3)
    low, high = 1e3 * mesh.vertices.min(axis=0), 1e3 * mesh.vertices.max(axis=0)
    assert (cells[:, :3] > low - 1).all()
    assert (cells[:, :3] < high + 1).all()


def test_sides_of_a_thin_plate_are_different_cells():
    up, down = (
        se3.make(se3.frame_from_normal(np.array([[0, 0, z]]), np.zeros(1)), np.zeros((1, 3))) for z in (1.0, -1)
    )
    cells = error_by_place(np.concatenate([up, down]), np.array([0.1, 0.9]))
    assert sorted(row[6] for row in cells) == [0.1, 0.9]


def test_several_objects_and_their_mean(measure):
    plan = SingleTouchPlan(60, Lighting())
    objects = [measure(plan) | {"object": name} for name in ("mug", "can")]
    objects[1]["summary"] = {key: 3 * value for key, value in objects[1]["summary"].items()}
    content = summarise_objects(objects)
    assert content["object"] == "mean of 2 objects"
    assert content["queries"] == 60
    first = objects[0]["summary"]["normalised_top25_error"]
    assert content["summary"]["normalised_top25_error"] == pytest.approx(2 * first)
    table, notes = single_touch_table(content), single_touch_notes(content)
    assert [name.split()[0] for name in table["object"]] == ["mug", "can", "mean"]
    assert table["mean"][2] == f"{2 * first:.3f}"
    assert f"{content['summary']['median_of_medians']:.3f}" in notes[-1]


def test_exhaustive_comparisons_are_means_over_all_touches(measure):
    objects = [measure(SingleTouchPlan(60, Lighting())) for _ in range(2)]
    assert summarise_objects(objects)["exhaustive"] is None
    for one, more in zip(objects, (0.0, 0.2), strict=True):
        codes = np.linspace(0.2, 0.6, 10) + more
        errors = {"tcn": codes, "measured_maps": codes - 0.1, "true_maps": codes - 0.3, "nearest_entry": 0 * codes}
        one["exhaustive"] = {"book_size": 300, "errors": errors}
    content = summarise_objects(objects)
    limits = content["exhaustive"]
    assert limits["tcn"]["error"]["value"] == pytest.approx(0.5)
    assert limits["measured_maps"]["over_codes"]["value"] == pytest.approx(-0.1)
    assert limits["measured_maps"]["over_codes"]["interval"] == pytest.approx([-0.1, -0.1])
    low, high = limits["true_maps"]["error"]["interval"]
    assert low < 0.2 < high
    assert limits["true_maps"]["trials"] == 20
    # fewer than 100 touches are no ground for a claim
    assert set(single_touch_limits(limits)["mean error"]) == {"too few (20)"}


def test_one_object_stands_for_itself(measure):
    content = summarise_objects([measure(SingleTouchPlan(60, Lighting()))])
    assert content["object"] == "block"
    assert list(single_touch_table(content)["object"]) == ["block"]
