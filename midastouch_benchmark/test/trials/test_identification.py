import dataclasses

import numpy as np
import pytest

from midastouch_benchmark.statistics.exploring import calibration_error, summarise_identification
from midastouch_benchmark.tables.experiments import EXPERIMENTS
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.identification import IdentityPlan, identify
from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.identification.catalogue import read_catalogue
from midastouch_perception.objects import bundled_objects
from midastouch_tools.jobs import Workers


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Two bundled objects, slid over for 60 mm each: the plan, meshes and slides."""
    folder = tmp_path_factory.mktemp("identify")
    cache = Cache(folder, slides=SlideKind(0.06), codebook_size=300)
    meshes = [ObjectMesh.load(path) for _, path in sorted(bundled_objects().items())[:2]]
    plan = IdentityPlan(cache, FilterConfig(max_particles=500), (0,), tuple(mesh.path for mesh in meshes))
    slides, missing = plan.run(meshes, Workers())
    assert not missing
    return plan, meshes, slides


@pytest.mark.slow
def test_every_slide_is_run_with_the_object_and_without(campaign):
    _, meshes, slides = campaign
    trials = [trial for slide in slides for trial in slide["trials"]]
    names = [mesh.name for mesh in meshes]
    assert [(t["object"], t["in_catalogue"], t["objects"]) for t in trials] == [
        (name, there, 2 if there else 1) for name in names for there in (True, False)
    ]
    for trial in trials:
        assert 0 < trial["confidence"] <= 1
        assert [at for at, *_ in trial["asked"]] == pytest.approx([0.05], abs=0.005)
        assert all((key in trial) is trial["in_catalogue"] for key in ("alone_cpu_ms", "alone_pose_right"))
        assert trial["cpu_ms"] > 0
        assert trial["right"] == (trial["right_from_m"] is not None)


@pytest.mark.slow
def test_finished_slides_are_kept_and_a_deadline_ends(campaign, bars):
    plan, meshes, slides = campaign
    again, _ = plan.run(meshes, Workers())
    further = dataclasses.replace(plan, slides=(0, 1))
    _, missing = further.run(meshes, Workers(), deadline=-np.inf)
    assert bars[0].total == 0
    assert again == slides
    assert missing == 2


@pytest.mark.slow
def test_before_the_first_touch_no_object_is_named(campaign):
    plan, meshes, _ = campaign
    books = [plan.cache.codebook_path(mesh) for mesh in meshes]
    catalogue = read_catalogue(books, lambda path: None, plan.config, plan.cache.sensor)
    frames = [TrialFrame(k, Measurement(False), {}, np.eye(4), np.eye(4)) for k in range(3)]
    found = identify(catalogue, frames, meshes[0].name, plan.config)
    assert not found["right"]
    assert found["pose_right"] is False


def trial(number, in_catalogue=True, right=True, confidence=0.9, **other):
    return {
        "object": f"object_{number % 5}", "slide": number, "in_catalogue": in_catalogue, "right": right,
        "confidence": confidence, "asked": [], "answer": "this" if right else "that", "pose_right": right,
        "right_from_m": 0.1 if right else None, "cpu_ms": 3.0,
        "alone_cpu_ms": 2.0, "alone_pose_right": right,
    } | other  # fmt: skip


def test_the_summary_counts_both_kinds_of_trials():
    trials = [trial(k, right=k >= 10) for k in range(100)] + [trial(k, False, k >= 20) for k in range(100)]
    summary = summarise_identification(trials)
    assert summary["right"]["share"] == pytest.approx(0.9)
    assert summary["refused"]["share"] == pytest.approx(0.8)
    low, high = summary["right"]["interval"]
    assert low < 0.9 < high
    assert summary["path_until_right"]["value"] == pytest.approx(0.1)
    assert summary["cpu_ratio"]["value"] == pytest.approx(1.5)
    assert summary["calibration_error"] == pytest.approx(0.05)
    assert summary["answers"]["object_0 -> that"] == 2
    assert summary["enough"]
    ((_, table),) = EXPERIMENTS["identify"].tables({"identification": summary})
    assert table["slides"][0] == "100 with, 100 without"
    assert table["right at the end"][0].startswith("90 % (")


def test_few_trials_claim_nothing():
    ((_, table),) = EXPERIMENTS["identify"].tables(
        {"identification": summarise_identification([trial(0), trial(1, False)])}
    )
    assert set(table.iloc[0, 2:]) == {"too few (1)"}


def test_probabilities_that_come_true_are_calibrated():
    answers = [(0.75, k % 4 != 0) for k in range(400)]
    assert calibration_error(answers) == pytest.approx(0.0)
    assert calibration_error([(0.95, False)] * 10) == pytest.approx(0.95)
    assert calibration_error([]) is None
