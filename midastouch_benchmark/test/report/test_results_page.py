import html
import signal

import numpy as np
import pytest

from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.statistics.accuracy import summarise_trials
from midastouch_benchmark.tables.experiments import EXPERIMENTS
from midastouch_benchmark.tables.reports import report
from midastouch_benchmark.trials.trial import ERROR_KEYS
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.drawing.page import Page


@pytest.fixture
def evaluation(run, make_trial) -> dict:
    trials = []
    for seed in range(3):
        errors = {key: [10.0 / (i + seed + 1) for i in range(len(run))] for key in ERROR_KEYS}
        poses = [None] + [se3.to_xyzquat(s.truth).tolist() for s in run[1:]]
        frames = {"frame": list(range(len(run))), "estimate": poses, **errors}
        final = {key: column[-1] for key, column in errors.items()}
        trials.append(make_trial("", seed, 10.0, final, sequence="ball/00", object="ball", per_frame=frames))
    return {
        "config": {"init": "paper", "beta": 1.0, "stride": 1, "networks": {"tdn": "t-1", "tcn": "c-1"}},
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


def test_every_kind_of_result_has_its_tables_on_the_page(tmp_path):
    results = {}
    for name in ("checks", "bench", "identify", "presses_vocdex", "evaluate_tdn", "soft_gel", "start", "exploration",
                 "motion", "observer_uniform", "scale"):  # fmt: skip
        kind = next(k for k, e in EXPERIMENTS.items() if all(key in report(name) for key in e.keys))
        results[kind] = f"{name}.json", report(name)
    assert len(results) == 11
    content = html.unescape(write_results_page(list(results.values()), tmp_path).read_text())
    for kind, (_, result) in results.items():
        experiment = EXPERIMENTS[kind]
        cells = [str(cell) for _, table in experiment.tables(result) for cell in table.to_numpy().ravel()]
        assert [text for text in (*cells, *experiment.notes(result)) if text not in content] == [], kind


def test_a_page_that_is_broken_off_leaves_the_one_before(evaluation, tmp_path, monkeypatch):
    write_results_page([("a.json", evaluation)], tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(Page, "write_markdown", lambda *_: signal.raise_signal(2))
    with pytest.raises(KeyboardInterrupt):
        write_results_page([("b.json", report("exploration")), ("a.json", evaluation)], tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("content", [{}, {"trials": []}, {"tdn_ms": {}}, {"trials": [], "sequences": []}, {"a": 1}])
def test_foreign_and_incomplete_files_are_refused(content, tmp_path):
    with pytest.raises(InputError, match=r"x\.json: "):
        write_results_page([("x.json", content)], tmp_path / "page")
    assert not (tmp_path / "page" / "index.html").exists()
