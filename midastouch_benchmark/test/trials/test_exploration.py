"""Closed loop with a simulated finger on a bundled object."""

import pytest

from midastouch_benchmark.trials import exploration
from midastouch_benchmark.trials.cache import Cache
from midastouch_benchmark.trials.cad_parts import CAD_PARTS
from midastouch_benchmark.trials.exploration import ExplorationPlan
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_perception.objects import bundled_objects
from midastouch_tools.jobs import Workers


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    """Where it is told to and at random, for 30 mm each."""
    folder = tmp_path_factory.mktemp("exploration")
    mesh = ObjectMesh.load(bundled_objects()["eyebolt"])

    def run():
        return run_plan(folder, ("suggested", "random"), 0.03, mesh)

    return run(), run


@pytest.mark.slow
def test_each_policy_is_tried_from_the_same_start(explored):
    (trials, missing), _ = explored
    assert not missing
    assert [(t["policy"], t["seed"]) for t in trials] == [("suggested", 0), ("random", 0)]
    suggested, random = trials
    assert suggested["asked_ms"][0] <= suggested["asked_ms"][1]
    assert random["asked_ms"] is None


@pytest.mark.slow
def test_a_way_ends_converged_or_where_it_is_too_long(explored):
    (trials, _), _ = explored
    for trial in trials:
        assert trial["ending"] in ("converged", "alike", "given up")
        least = 0.03 if trial["ending"] == "given up" else 0.0
        assert least <= trial["path_m"] <= 0.2  # the motion under way is ended


@pytest.mark.slow
def test_the_same_command_goes_on_and_finds_the_same(explored):
    first, run = explored
    assert run() == first


def run_plan(folder, policies, length, *meshes, trials=1):
    """Trials with a small codebook and few particles, and the number of missing ones."""
    config, catalogue = FilterConfig(max_particles=1000, threads=1), tuple(mesh.path for mesh in meshes)
    plan = ExplorationPlan(Cache(folder, codebook_size=400), config, policies, trials, length, catalogue)
    return plan.run(meshes, Workers())


def trials_of(folder, policy, length, *meshes, trials=1):
    return run_plan(folder, (policy,), length, *meshes, trials=trials)[0]


@pytest.mark.slow
def test_an_arm_in_mujoco_explores_too(tmp_path):
    pytest.importorskip("mujoco", reason="needs MuJoCo: pip install -r tools/requirements/mujoco.txt")
    (trial,) = trials_of(tmp_path, "arm", 0.05, ObjectMesh.load(bundled_objects()["handle_tool"]))
    assert trial["seconds"] > 3
    assert trial["path_m"] >= 0.05 or trial["ending"] != "given up"


@pytest.mark.slow
def test_a_first_touch_that_is_not_felt_is_gone_on_from(tmp_path, monkeypatch):
    measured, numb = exploration.measurement_of, iter([True] * 60)
    monkeypatch.setattr(
        exploration, "measurement_of", lambda answer: Measurement(False) if next(numb, False) else measured(answer)
    )
    (trial,) = trials_of(tmp_path, "suggested", 0.01, ObjectMesh.load(bundled_objects()["eyebolt"]))
    assert trial["path_m"] > 0


@pytest.mark.slow
def test_a_finger_that_begins_over_a_hole_goes_elsewhere(tmp_path):
    """As with the second seed on this flange."""
    CAD_PARTS["flange_4"]("flange_4").save(tmp_path / "flange_4.ply")
    trials = trials_of(tmp_path, "random", 0.01, ObjectMesh.load(tmp_path / "flange_4.ply"), trials=2)
    assert all(trial["path_m"] > 0 for trial in trials)


@pytest.mark.slow
def test_an_arm_is_told_neither_object_nor_pose(tmp_path):
    pytest.importorskip("mujoco", reason="needs MuJoCo: pip install -r tools/requirements/mujoco.txt")
    meshes = [ObjectMesh.load(bundled_objects()[name]) for name in ("handle_tool", "eyebolt")]
    for policy, right in ("arm_catalogue", "converged"), ("arm_stranger", "another object"):
        trials = trials_of(tmp_path, policy, 0.005, *meshes)
        assert {trial["object"] for trial in trials} == {"handle_tool", "eyebolt"}
        assert all(trial["right"] <= (trial["ending"] in (right, "given up")) for trial in trials)
        assert all(trial["error_mm"] is None for trial in trials if policy == "arm_stranger")
