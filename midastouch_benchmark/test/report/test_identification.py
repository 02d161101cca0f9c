from midastouch_benchmark.report.results_page import write_results_page


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
    assert "90%" in page
    assert "0.020" in page
