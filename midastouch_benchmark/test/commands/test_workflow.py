"""A user's first hour, small: simulate, build a codebook, evaluate everything, report. With the shipped networks."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from meshes import without_symmetry_search
from stays import stays

from midastouch_benchmark.speed import scaling
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, background_colours
from midastouch_perception.sensor_model import LIGHTS, SensorModel
from midastouch_tools import cli
from midastouch_tools.commands.arguments import load_mesh
from midastouch_tools.datasets.sequence import read_image

TIMES = {"p50", "p95", "cpu"}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    """A folder with a slide over the eyebolt and its codebook, made by the commands."""
    folder = tmp_path_factory.mktemp("workspace")
    with pytest.MonkeyPatch.context() as patch, without_symmetry_search():
        patch.chdir(folder)
        assert cli.main(["simulate", "eyebolt", "--out", "eyebolt/00", "--length", "0.015", "--seed", "1"]) == 0
        assert cli.main(["build-codebook", "eyebolt", "--size", "300"]) == 0
    (folder / "small.yaml").write_text("max_particles: 2000\n")
    return folder


@pytest.fixture
def run(workspace, monkeypatch, capsys):
    """Run a command in the workspace; returns its output and the JSON it wrote, if any."""
    monkeypatch.chdir(workspace)

    def run(*arguments: str) -> tuple[str, dict | None]:
        status = cli.main(list(arguments))
        captured = capsys.readouterr()
        assert status == 0, captured.err
        written = arguments[arguments.index("--json") + 1] if "--json" in arguments else None
        return captured.out, written and json.loads(Path(written).read_text())

    return run


def test_evaluate_finds_mesh_and_codebook_by_name(run):
    output, result = run("evaluate", "eyebolt/00", "--config", "small.yaml", "--json", "evaluate.json")
    assert [t["sequence"] for t in result["trials"]] == ["eyebolt/00"]
    assert result["summary"]["objects"]["eyebolt"]["trials"] == 1
    assert result["sequences"][0]["background"] == "background.png"
    assert result["trials"][0]["ms"]["tdn"] > 0
    assert result["machine"]["versions"]["onnxruntime"]
    assert result["config"]["filter"]["max_particles"] == 2000
    assert "eyebolt" in output


def test_evaluate_asks_which_object_it_is(run):
    output, result = run("evaluate", "eyebolt/00", "--objects", "out/codebooks", "--json", "which.json")
    assert result["catalogue"] == ["eyebolt"]
    (one,) = result["identified"]
    assert (one["sequence"], one["truth"]) == ("eyebolt/00", "eyebolt")
    assert one["answer"] in ("eyebolt", "unknown")
    assert f"{one['confidence']:.0%}" in output
    assert cli.main(["evaluate", "eyebolt/00", "--objects", "eyebolt.ply"]) == cli.EXIT_BAD_INPUT


@pytest.fixture
def real_slide(real_sequence_folder) -> Path:
    """A real slide aligned with the eyebolt's surface."""
    path, poses = real_sequence_folder(n=9)
    file = path.parent / "alignment.npy"
    places = poses[:, :3, 3].mean(axis=0, keepdims=True)
    onto = load_mesh("eyebolt").closest_points(places)[0] - places
    alignment = np.load(file)
    alignment[:3, 3] += onto[0]
    np.save(file, alignment)
    return path


def test_what_a_sequence_does_not_allow_is_refused(run, real_slide, capsys):
    options = ["--mesh", "eyebolt", "--codebook", "out/codebooks/eyebolt.npz"]
    assert cli.main(["evaluate", str(real_slide), "--real", "--init", "uniform", *options]) == 2
    assert "--real: the paper's starts are about the truth" in capsys.readouterr().err
    assert cli.main(["evaluate", str(real_slide), "eyebolt/00", *options]) == 2
    assert "sequences of different sensors (digit_real, digit_tacto)" in capsys.readouterr().err
    assert cli.main(["evaluate", str(real_slide), *options]) == 2
    error = capsys.readouterr().err
    assert re.search("built for the sensor digit_tacto, not for digit_real; .* --sensor digit_real", error)


def test_a_calibration_and_a_no_contact_image_can_be_given(run, capsys):
    background, sensor = read_image(Path("eyebolt/00/background.png")), SensorModel.load("digit_tacto")
    made = {"serial": "", "ball_diameter": 6e-3, "sensor": sensor.name, "presses": 5}
    made |= {"pixel_size": sensor.pixel_size, "coefficients": np.full((12, 6, 2), 1e-3), "date": "2026-11-23"}
    calibration = SensorCalibration(**made, background=background_colours(background))
    calibration.save("own.npz")
    dataclasses.replace(calibration, background=background_colours(background[:, ::-1, ::-1])).save("other.npz")
    shutil.copy("eyebolt/00/background.png", "free.png")
    options = ("--background", "free.png", "--calibration", "own.npz", "--json", "calibrated.json")
    _, depth = run("evaluate-perception", "tdn", "eyebolt/00", *options)
    _, without = run("evaluate-perception", "tdn", "eyebolt/00", "--json", "plain.json")
    assert depth["sequences"][0]["background"] == "free.png"
    assert depth["summary"]["rmse_mm"] != without["summary"]["rmse_mm"]
    _, result = run("evaluate", "eyebolt/00", *options, "--max-frames", "3", "--config", "small.yaml")
    assert result["config"]["networks"]["calibration"] == "5 presses of a ball of 6 mm, 2026-11-23"
    assert result["sequences"][0]["background"] == "free.png"
    for command in (["evaluate"], ["evaluate-perception", "tdn"]):
        assert cli.main([*command, "eyebolt/00", "--calibration", "other.npz"]) == 2
        assert "another gel or another sensor" in capsys.readouterr().err


def test_real_slides_beside_the_paper_s(run, real_slide):
    path = real_slide
    options = ("--mesh", "eyebolt", "--codebook", "out/codebooks/eyebolt.npz", "--sensor", "digit_tacto")
    output, result = run("evaluate", str(path), "--real", *options, "--config", "small.yaml", "--json", "real.json")
    assert result["config"]["beta"] == 0.5
    assert result["paper_real"]["e_trans_mm"] == 19.7
    (line,) = (line for line in output.splitlines() if line.startswith("particles, mean"))
    assert line.endswith("19.7 mm, 21.5 deg")
    assert float(line.split()[2]) == pytest.approx(result["summary"]["e_trans_mm"]["mean"], abs=0.051)
    run("report", "real.json", "--out", "real_report")
    assert "19.7" in Path("real_report/index.html").read_text()


def test_the_depth_network_is_evaluated(run):
    output, result = run("evaluate-perception", "tdn", "eyebolt/00", "--json", "tdn.json")
    (sequence,) = result["sequences"]
    assert set(sequence) >= {
        "sequence", "frames", "rmse_mm", "contact_rmse_mm", "contact_iou", "ms_per_frame", "background",
    }  # fmt: skip
    assert sequence["rmse_mm"] == pytest.approx(result["summary"]["rmse_mm"])
    assert 0 < sequence["rmse_mm"] < 0.4
    assert "eyebolt/00" in output


def test_single_touch(run):
    output, result = run(
        "single-touch", "eyebolt", "--codebook", "out/codebooks", "--queries", "25", "--exhaustive", "3",
        "--json", "touch.json",
    )  # fmt: skip
    assert set(result["summary"]) >= {
        "normalised_top25_error", "median", "random_error", "geodesic_normalised_top25_error",
    }  # fmt: skip
    summary = result["summary"]
    assert 0 < summary["nearest_entry"] <= summary["normalised_top25_error"] < 1.5
    assert (result["object"], result["queries"]) == ("eyebolt", 25)
    limits = {way: each["error"]["value"] for way, each in result["exhaustive"].items()}
    assert 0 < limits["nearest_entry"] <= min(limits.values())
    assert set(limits) == {"tcn", "measured_maps", "true_maps", "nearest_entry"}
    assert "true map, with each pose" in output
    assert "eyebolt" in output


@pytest.mark.slow
def test_bench_has_the_keys_of_the_design(run):
    _, result = run("bench", "--object", "eyebolt", "--codebook-size", "300", "--frames", "10", "--json", "bench.json")
    for key in ("tdn_ms", "tcn_ms", "end_to_end_ms", "frame_ms"):
        assert set(result[key]) == TIMES
    assert "searching" in result["filter_ms"]
    assert result["filter_ms"].keys() == result["deferred_ms"].keys() <= {"searching", "converged"}
    assert set(result["align_ms"]) == set(result["lookup_ms"]) == set(result["filter_ms"]["searching"]) == TIMES
    assert result["frame_ms"]["p50"] > result["end_to_end_ms"]["p50"]
    assert 0 < result["lookup_exact_share"] <= 1
    assert {light: set(times) for light, times in result["sim_image_ms"].items()} == dict.fromkeys(LIGHTS, TIMES)
    assert 0 < result["pose_age_ms"]["p50"] <= result["pose_age_ms"]["p95"]
    assert 0 < result["filter_start_s"]["p50"] <= result["filter_start_s"]["max"]
    positive = ("threads", "pose_age_hz", "filter_rss_mb", "end_to_end_hz", "renders_per_s", "codebook_poses_per_s",
                "peak_rss_mb")  # fmt: skip
    assert all(result[key] > 0 for key in positive)


@pytest.mark.slow
def test_bench_scale_measures_each_size(run, monkeypatch):
    monkeypatch.setattr(scaling, "USUAL", 300)  # poses and particles of what is not varied
    sizes = ("--particles", "100", "--poses", "200", "--frames", "10")
    output, result = run("bench-scale", "--object", "eyebolt", *sizes, "--json", "scale.json")
    assert [(point["particles"], point["poses"]) for point in result["scaling"]] == [(100, 300), (300, 200)]
    assert all(set(point["step_ms"]) == TIMES and point["memory_mb"] > 0 for point in result["scaling"])
    assert len(output.splitlines()) == 4


@pytest.mark.parametrize(
    ("arguments", "most"),
    [
        (["evaluate", "eyebolt/00"], 20),
        (["benchmark", "--objects", "eyebolt", "--slides", "1", "--codebook-size", "300"], 17),
    ],
)
def test_work_is_reached_through_few_functions(workspace, monkeypatch, arguments, most):
    monkeypatch.chdir(workspace)
    assert len(stays(arguments)) <= most, "inline what has one caller; lower this number with the count"


@pytest.mark.slow
def test_benchmark_compares_variants_and_continues(run, workspace):
    options = (
        "benchmark", "--objects", "eyebolt", "--out", "bm", "--slides", "1", "--length", "0.015", "--seeds", "1",
        "--init", "paper", "--codebook-size", "300", "--config", "small.yaml", "--json", "benchmark.json",
    )  # fmt: skip
    output, result = run(*options, "--variant", "5k")
    assert [(t["variant"], t["frames"]) for t in result["trials"]] == [("default", 10), ("5k", 10)]
    assert result["trials"][0]["ms"]["tdn"] > 0
    assert result["objects"][0]["symmetry"] == "2 poses alike"
    assert "at most 5,000 poses" in output
    assert result["command"].startswith("midastouch benchmark --objects eyebolt --slides 1")
    (log,) = (workspace / "bm").glob("*/trials.jsonl")
    finished = log.read_text()
    _, again = run(*options, "--variant", "5k")
    assert again["trials"] == result["trials"]
    assert log.read_text() == finished
    page, _ = run("report", "benchmark.json", "--out", "benchmark_report")
    assert page.strip() == "benchmark_report/index.html"


@pytest.mark.slow
def test_a_campaign_has_the_same_results_on_two_workers(run, workspace):
    options = (
        "benchmark", "--objects", "eyebolt", "handle_tool", "--slides", "2", "--length", "0.03", "--seeds", "2",
        "--codebook-size", "300", "--config", "small.yaml", "--protocol", "push",
    )  # fmt: skip
    finals = []
    for jobs in ("1", "2"):
        _, result = run(*options, "--out", f"workers_{jobs}", "--jobs", jobs, "--json", f"workers_{jobs}.json")
        assert result["missing_trials"] == 0
        finals.append([t["final"] | {"event_at": t["event_at"], "seed": t["seed"]} for t in result["trials"]])
    assert len(finals[0]) == 8
    assert finals[0] == finals[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate", "eyebolt/00", "--mesh", "ball"], "built for the mesh 'eyebolt', not for this 'ball'"),
        (["evaluate", "eyebolt/00", "--sensor", "digit_real"], "build-codebook eyebolt --sensor digit_real --out"),
        (["evaluate", "eyebolt/00", "--real"], "eyebolt/00: not a real slide of YCB-Slide"),
        (["evaluate", "eyebolt/00", "--config", "out"], "out: is a folder; give the configuration file"),
        (["evaluate", "eyebolt/00", "--codebook", "out"], "out: is a folder; give the codebook file"),
        (["evaluate", "eyebolt/00", "--objects", "a", "--mesh", "ball"], "in place of --mesh and --codebook; leave"),
        (["evaluate", "eyebolt/00", "--objects", "none"], "none: no such codebook or folder of codebooks"),
        (["download", "ycb-mesh"], "name what to download"),
        (["evaluate", "eyebolt/00", "--tdn", "slow"], "tdn network 'slow' is not known"),
        (["evaluate", "eyebolt/00", "--config", "none.yaml"], "none.yaml"),
        (["evaluate-perception", "tdn", "eyebolt/00", "--background", "none.png"], "none.png"),
        (["bench", "--frames", "3"], "--frames 3: too few"),
        (["bench-scale", "--frames", "3"], "--frames 3: too few"),
        (["benchmark", "--preset", "quick"], "preset quick: not known; there are fast, balanced"),
        (["benchmark", "--objects", "teapot"], "bundled objects: no object 'teapot': there are ball, eyebolt"),
        (["benchmark", "--meshes", "none"], "none: no such folder"),
        (["benchmark", "--variant", "best"], "--variant best: not known"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(workspace, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(workspace)
    assert cli.main(arguments) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert lines[-1].startswith("midastouch: error: ")
    assert message in lines[-1]
