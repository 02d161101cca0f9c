"""Progress bars where stderr is no terminal."""

import re
import time

from midastouch_tools.progress import Bars, close_bars, progress_bar


def test_in_a_log_a_bar_is_a_line_now_and_then(capsys, monkeypatch):
    now = 1000.0
    monkeypatch.setattr("tqdm.std.time", lambda: now)
    with progress_bar(total=40, unit="pose", desc="codebook of mug") as bar:
        for _ in range(40):  # for 20 s
            now += 0.5
            bar.update()
    text = capsys.readouterr().err
    lines = text.splitlines()
    assert "\r" not in text
    assert all(line.startswith("codebook of mug: ") for line in lines)
    shown = [int(re.search(r"(\d+)/40", line)[1]) for line in lines]
    assert shown[:3] == [10, 20, 30]
    assert shown[-1] == 40


def test_each_step_has_its_bar_and_one_without_an_end_counts(capsys, monkeypatch):
    now = 1000.0
    monkeypatch.setattr("tqdm.std.time", lambda: now)
    bars = Bars()
    for _ in range(3):
        bar = bars.of("symmetry of mug", "motion")
        now += 6
        bar.update()
    bar = bars.of("codebook of mug", "pose", 40)
    now += 6
    bar.update(40)
    bars.close()
    lines = capsys.readouterr().err.splitlines()
    first = [line for line in lines if line.startswith("symmetry of mug: ")]
    assert lines[: len(first)] == first
    assert first[-1] == "symmetry of mug: 3 motions, 00:18"
    assert lines[-1].startswith("codebook of mug: 100%")


def test_an_error_at_once_has_no_bar_before_it(capsys, monkeypatch):
    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 3600.0)
    progress_bar(total=40, unit="pose").update()
    close_bars()
    assert capsys.readouterr().err == ""


def test_a_long_first_step_has_its_bar(capsys, monkeypatch):
    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 0.01)
    with progress_bar(total=40, unit="pose"):
        shown = ""
        while not shown:
            time.sleep(0.01)
            shown = capsys.readouterr().err
    assert "0/40" in shown
