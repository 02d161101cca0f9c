from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.report.scaling import scaling_figure


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
    assert 'src="scaling_0.png"' in page
    assert (tmp_path / "scaling_0.png").stat().st_size > 5000
