import pytest

from midastouch_benchmark.statistics.exploring import summarise_shapes
from midastouch_benchmark.tables.exploring import shapes_table
from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_benchmark.trials.shape_catalogues import ShapePlan, run_shapes
from midastouch_benchmark.trials.trial_log import TrialLog, Workforce
from midastouch_bringup import cli
from midastouch_bringup.cluster import open_cluster
from midastouch_filter.core.config import FilterConfig


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Catalogues of one and of three shapes, with room for one; one shape is slid over for 60 mm."""
    folder = tmp_path_factory.mktemp("shapes")
    cache = Cache(folder, slides=SlideKind(0.06), codebook_size=300)
    plan = ShapePlan(cache, FilterConfig(), (0,), room=300, sizes=(1, 3), touched=1)
    log = TrialLog(folder / "log.jsonl")
    with open_cluster() as cluster:
        trials, missing = run_shapes(plan, log, Workforce(cluster))
    assert not missing
    return plan, log, trials


@pytest.mark.slow
def test_a_slide_is_run_in_every_catalogue_with_the_shape_and_without(campaign):
    _, _, trials = campaign
    assert [(t["size"], t["in_catalogue"]) for t in trials] == [(1, True), (3, True), (3, False)]
    assert {t["object"] for t in trials} == {"shape_0000"}
    assert trials[0]["late"]["compared"]
    assert trials[0]["late"]["leads"]
    assert not trials[2]["late"]["compared"]
    assert all(0 < t["cpu_ms"] <= t["slowest_ms"] for t in trials)


@pytest.mark.slow
def test_what_was_run_is_not_run_again(campaign):
    plan, log, trials = campaign
    begun = []
    with open_cluster() as cluster:
        watched = Workforce(cluster, start_progress=lambda total: begun.append(total) or (lambda done: None))
        again, _ = run_shapes(plan, log, watched)
    assert begun == [0]
    assert again == trials


def trial(number, size, in_catalogue=True, right=True, compared=True):
    return {
        "object": f"shape_{number}", "slide": 0, "size": size, "in_catalogue": in_catalogue, "right": right,
        "early": {"compared": compared, "leads": False}, "late": {"compared": True, "leads": right}, "cpu_ms": 2.0,
        "slowest_ms": 9.0, "memory_mib": 300.0,
    }  # fmt: skip


def test_the_summary_is_by_the_size_of_the_catalogue():
    trials = [trial(k, 10, right=k >= 10, compared=k >= 20) for k in range(100)]
    trials += [trial(k, 10, in_catalogue=False, right=k >= 30) for k in range(100)] + [trial(0, 1000)]
    summary = summarise_shapes(trials)
    assert list(summary) == ["10", "1000"]
    ten = summary["10"]
    fractions = {
        key: ten[key]["share"] for key in ("compared_early", "leads_early", "compared", "leads", "right", "refused")
    }
    assert fractions == pytest.approx(
        {"compared_early": 0.8, "leads_early": 0.0, "compared": 1.0, "leads": 0.9, "right": 0.9, "refused": 0.7}
    )
    table = shapes_table(summary)
    assert table["compared after 0.1 m"][0].startswith("80 %")
    assert set(table.iloc[1, 2:]) == {f"too few ({summary['1000']['known']})"}


def test_shapes_and_meshes_do_not_go_together(capsys):
    assert cli.main(["identify", "--shapes", "2", "--meshes", "somewhere"]) == 2
    assert "leave --meshes and --objects out" in capsys.readouterr().err
