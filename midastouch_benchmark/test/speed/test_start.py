import pytest

from midastouch_benchmark.speed.start import first_poses, summarise_first_poses
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_common.mesh import ObjectMesh
from midastouch_filter import loaded_object
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.objects import bundled_objects


def test_the_first_touch_of_each_slide_is_answered(tmp_path, monkeypatch):
    monkeypatch.setattr(loaded_object, "SIZE", 300)
    monkeypatch.setattr(loaded_object, "DENSE", 400)  # not what is measured
    mesh = ObjectMesh.load(bundled_objects()["eyebolt"])
    cache = Cache(tmp_path, slides=SlideKind(0.02))
    trials = first_poses(mesh, cache, (0, 1), FilterConfig(max_particles=500, threads=1))
    assert [(trial["object"], trial["slide"]) for trial in trials] == [("eyebolt", 0), ("eyebolt", 1)]
    assert trials[0]["build_s"] == trials[1]["build_s"] > 0
    assert all(trial["step_s"] > 0 for trial in trials)


def trial(number, build, step=0.5):
    return {"object": f"object_{number}", "slide": 0, "build_s": build, "build_cpu_s": 2 * build, "step_s": step}


def test_what_a_pose_has_waited_for_is_summed_up():
    summary = summarise_first_poses([trial(k, build) for k, build in enumerate((1.0, 2.0, 6.0)) for _ in range(10)])
    assert summary["first_pose_s"]["value"] == pytest.approx(2.5)
    assert summary["first_pose_s"]["max"] == pytest.approx(6.5)
    low, high = summary["first_pose_s"]["interval"]
    assert low <= 2.5 <= high
    assert summary["build_cpu_s"] == pytest.approx(6.0)
    assert (summary["trials"], summary["objects"], summary["enough"]) == (30, 3, False)
