import html
import signal

import numpy as np
import pytest

from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.statistics.accuracy import summarise_trials
from midastouch_benchmark.tables.experiments import EXPERIMENTS
from midastouch_benchmark.tables.reports import report
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.drawing.page import Page

KEYS = [
    f"{prefix}_{unit}"
    for prefix in ("e", "min_cluster", "closest_mode", "estimate")
    for unit in ("trans_mm", "rot_deg")
]


def trial(seed: int, run) -> dict:
    errors = {key: [10.0 / (i + seed + 1) for i in range(len(run))] for key in KEYS}
    return {
        "sequence": "ball/00",
        "object": "ball",
        "seed": seed,
        "initial": {"e_trans_mm": 20.0, "e_rot_deg": 60.0},
        "final": {key: column[-1] for key, column in errors.items()}
        | {"state": "converged", "n_particles": 500, "right": True, "among_modes": True},
        "hz_mean": 50.0,
        "hz_p05": 40.0,
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


def newest_of_each_kind() -> dict[str, str]:
    """Names of reports in this tree, by kind."""
    found: dict[str, str] = {}
    for name in ("checks", "bench", "identify", "presses_vocdex", "evaluate_tdn", "soft_gel", "start", "exploration",
                 "motion", "observer_uniform", "scale"):  # fmt: skip
        found[next(k for k, e in EXPERIMENTS.items() if all(key in report(name) for key in e.keys))] = name
    return found


def test_every_kind_of_result_has_its_tables_on_the_page(tmp_path):
    kinds = newest_of_each_kind()
    assert len(kinds) == 11
    results = {kind: (f"{name}.json", report(name)) for kind, name in kinds.items()}
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
