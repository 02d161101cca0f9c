import numpy as np
import pytest

from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.report.trial_figures import scaling_figure
from midastouch_benchmark.statistics.accuracy import summarise_trials
from midastouch_common import se3
from midastouch_common.errors import InputError

KEYS = [
    f"{prefix}_{unit}"
    for prefix in ("e", "min_cluster", "closest_mode", "estimate")
    for unit in ("trans_mm", "rot_deg")
]
TIME = {"p50": 1.0, "p95": 2.0, "cpu": 1.5}


def trial(seed: int, run) -> dict:
    errors = {key: [10.0 / (i + seed + 1) for i in range(len(run))] for key in KEYS}
    return {
        "sequence": "ball/00",
        "object": "ball",
        "seed": seed,
        "initial": {"e_trans_mm": 20.0, "e_rot_deg": 60.0},
        "final": {key: column[-1] for key, column in errors.items()} | {"state": "converged", "n_particles": 500},
        "hz_mean": 50.0,
        "hz_p05": 40.0,
        "right_m": 0.01,
        "ms": {"tdn": 3.0, "tcn": 1.0, "filter": 10.0},
        "per_frame": {
            "frame": list(range(len(run))),
            "estimate": [None] + [se3.to_xyzquat(s.truth).tolist() for s in run[1:]],
            **errors,
        },
    }


@pytest.fixture
def evaluation(run) -> dict:
    trials = [trial(seed, run) for seed in range(3)]
    return {
        "config": {"init": "paper", "beta": 1.0, "seeds": 3, "stride": 1, "networks": {"tdn": "t-1", "tcn": "c-1"}},
        "machine": {"cpu": "a cpu"},
        "sequences": [
            {
                "sequence": "ball/00",
                "object": "ball",
                "mesh": "/nowhere/ball.ply",
                "truth": se3.to_xyzquat(np.array([s.truth for s in run])).tolist(),
            }
        ],
        "trials": trials,
        "summary": summarise_trials(trials),
    }


def test_an_evaluation_with_its_pictures(evaluation, tmp_path, ball):
    import trimesh

    mesh = tmp_path / "ball.ply"
    trimesh.Trimesh(ball.vertices, ball.faces, process=False).export(mesh)
    evaluation["sequences"][0]["mesh"] = str(mesh)
    page = write_results_page([("a.json", evaluation)], tmp_path / "out")
    content = page.read_text()
    assert "ball/00" in content
    for picture in ("evaluate_0.png", "evaluate_0_ball_00_errors.png", "evaluate_0_ball_00_paths.png"):
        assert f'src="{picture}"' in content
        assert (tmp_path / "out" / picture).stat().st_size > 5000


def test_without_the_mesh_the_page_says_so(evaluation, tmp_path):
    content = write_results_page([("a.json", evaluation)], tmp_path).read_text()
    assert "/nowhere/ball.ply is not there" in content


def test_the_other_kinds_of_result(tmp_path):
    bench = {
        "threads": 2,
        "codebook_size": 50000,
        "tdn_ms": TIME,
        "tcn_ms": TIME,
        "filter_ms": {"50000": TIME, "1000": TIME},
        "lookup_ms": {"50000": TIME},
        "end_to_end_hz": 41.5,
        "end_to_end_ms": TIME,
        "renders_per_s": 1234.5,
        "codebook_poses_per_s": 321.0,
        "peak_rss_mb": 512.0,
    }
    figures = {"rmse_mm": 0.123, "contact_rmse_mm": 0.2, "contact_iou": 0.9, "ms_per_frame": 3.0}
    depth = {"sequences": [{"sequence": "ball/00", "frames": 3, **figures}], "summary": figures}
    results = [("b.json", bench), ("d.json", depth)]
    content = write_results_page(results, tmp_path).read_text()
    for text in ("41.5 Hz", "0.123", "bench_0.png"):
        assert text in content


@pytest.mark.parametrize("content", [{}, {"trials": []}, {"tdn_ms": {}}, {"trials": [], "sequences": []}])
def test_foreign_and_incomplete_files_are_refused_by_name(content, tmp_path):
    with pytest.raises(InputError, match=r"x\.json"):
        write_results_page([("x.json", content)], tmp_path)


def test_a_foreign_file_leaves_no_folder_behind(tmp_path):
    with pytest.raises(InputError, match=r"x\.json: "):
        write_results_page([("x.json", {"a": 1})], tmp_path / "page")
    assert not (tmp_path / "page").exists()


def test_every_table_is_on_the_page(tmp_path):
    case = {"alarms": 0.25, "named_turned": 0.67, "quietest_tenth": 1.5, "explained_share": 0.75}
    case |= {"auc_quietest_tenth": 0.5, "auc_explained_share": None}
    touches = [{"from_mm": 0.05, "to_mm": 0.1, "touches": 7, "missed": 0.14}]
    result = {
        "network": "tdn_x-1",
        "sensor": "digit_tacto",
        "sensors": 40,
        "no_contact_images": 24,
        "fit_check": {"right": case},
        "no_contact_image": {"upside down": 1.0},
        "cause_named": {"upside down": 0.83},
        "real_sensors": {"d20641": {"trials": 62, "right": 0.02, "touched": 0.97}},
        "ball_diameter": {"given": [{"factor": 1.4, "doubted": 0.46}]},
        "capture": {"a touch refused": 0.98},
        "gels": {"another gel's no-contact image": {"trials": 26, "said": 0.96}},
        "light_touches": {"eyebolt; DIGIT": [touches[0] | {"missed": 0.29}]},
        "slow_light": [{"sensor": "DIGIT", "images": 12, "change": 0.05, "frames": 60, "false_contacts": 0.03}],
        "contact": {
            "missed": {"wire": touches},
            "false": [{"brighter": 0.02, "false_contacts": 0.03}],
            "false_while_warming": 0.011,
        },
    }
    content = write_results_page([("checks.json", result)], tmp_path).read_text()
    for text in ("tdn_x-1", "25 %", "upside down", "98 %", "83 %", "67 %", "wire", "0.05 to 0.1 mm", "14 %", "1.50",
                 "2 % brighter", "d20641", "97 %", "46 %", "3 %", "1 %", "96 %", "up to 5 %", "29 %",
                 "eyebolt; DIGIT"):  # fmt: skip
        assert text in content


def test_what_was_taken_for_what_is_on_the_page(tmp_path):
    figure = {"share": 0.9, "interval": [0.8, 0.95]}
    value = {"value": 0.12, "interval": None}
    summary = {
        "known": 200, "unknown": 200, "objects": 10, "enough": True, "right": figure, "pose_right": figure,
        "alone_pose_right": figure, "refused": figure, "path_until_right": value,
        "calibration_error": 0.02, "cpu_ratio": value,
        "answers": {"mug -> unknown": 3},
    }  # fmt: skip
    content = {"identification": summary, "catalogue": ["mug", "drill"], "trials": []}
    page = write_results_page([("identify.json", content)], tmp_path).read_text()
    assert "mug, drill" in page
    assert "mug -&gt; unknown: 3" in page
    assert "90 % (80%...95%)" in page
    assert "0.020" in page


def point(particles: int, poses: int) -> dict:
    milliseconds = particles / 1e4
    times = {"cpu": milliseconds, "p50": milliseconds, "p95": milliseconds}
    return {"particles": particles, "poses": poses, "step_ms": times, "memory_mb": poses / 1e3}


POINTS = [point(50_000, 50_000), point(100, 50_000), point(50_000, 1_000_000)]


def test_time_and_memory_are_drawn_over_each_number():
    curves = [axes.lines[0].get_xydata().tolist() for axes in scaling_figure(POINTS).axes]
    assert curves == [
        [[100, 0.01], [50_000, 5]],
        [[50_000, 5], [1_000_000, 5]],
        [[100, 50], [50_000, 50]],
        [[50_000, 50], [1_000_000, 1000]],
    ]


def test_the_page_has_table_and_curves(tmp_path):
    content = {"object": "ball", "frames": 60, "threads": 2, "scaling": POINTS}
    page = write_results_page([("scale.json", content)], tmp_path).read_text()
    assert "1,000,000" in page
    assert 'src="bench_scale_0.png"' in page
    assert (tmp_path / "bench_scale_0.png").stat().st_size > 5000
