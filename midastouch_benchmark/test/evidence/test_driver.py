"""Reports made again in their order, from where it was stopped."""

import pytest

from midastouch_benchmark.evidence import driver
from midastouch_benchmark.evidence.driver import Step
from midastouch_benchmark.tables import reports


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(driver, "ROOT", tmp_path)
    return tmp_path


def step(name: str, code: str, command: str = "midastouch benchmark") -> Step:
    return Step(name, f"{command} # {code}", True, "unknown")


@pytest.fixture
def shell(monkeypatch):
    """Writes what a step says after its `#` in place of what its command would."""

    def command_line(step, made, jobs, minutes):
        return f"echo {step.name} >> ran; echo '{step.command.split('# ')[1]}' > {made}"

    monkeypatch.setattr(driver, "command_line", command_line)


def test_whole_reports_replace_earlier_ones(root, shell):
    earlier = root / "reports" / "2001-01-01"
    earlier.mkdir(parents=True)
    for name in ("a", "c"):
        (earlier / f"{name}.json").write_text("{}")
    assert driver.carry_out([step("a", "{}"), step("b", '{"missing_trials": 0}')], jobs=2) == []
    assert sorted(path.name for path in root.glob("reports/*/*.json")) == ["a.json", "b.json", "c.json"]
    assert [path.name for path in earlier.iterdir()] == ["c.json"]


def test_after_a_report_with_missing_trials_nothing_follows(root, shell, capsys):
    driver.carry_out([step("a", '{"missing_trials": 3}'), step("b", "{}")], jobs=1)
    said = capsys.readouterr().out.splitlines()
    assert not list(root.glob("reports/*/*.json"))
    assert (root / "ran").read_text() == "a\n"
    assert "1 of 2" in said[0]
    assert "continues" in said[-1]


def test_a_command_that_fails_is_named_and_the_next_goes_on(root, monkeypatch, capsys):
    lines = iter(["exit 3", "echo {} > out/evidence/b.json"])
    monkeypatch.setattr(driver, "command_line", lambda *_: next(lines))
    assert driver.carry_out([step("a", ""), step("b", "")], jobs=1) == ["a"]
    assert "exit 3" in capsys.readouterr().out
    assert [path.name for path in root.glob("reports/*/*.json")] == ["b.json"]


def test_campaigns_are_shared_out_and_bounded(tmp_path):
    shared, alone = step("a", ""), step("b", "", "midastouch evaluate-perception tdn")
    assert driver.command_line(shared, tmp_path / "a", 2, 30).endswith(f" --jobs 2 --minutes 30.0 --json {tmp_path}/a")
    assert "--jobs" not in driver.command_line(alone, tmp_path / "b", 2, 30)
    prepared = driver.command_line(
        step("c", "", "midastouch simulate a && midastouch evaluate-perception tdn a"), tmp_path, 1, None
    )
    assert prepared.count(" -m midastouch_tools.cli ") == 2


def test_a_report_of_this_code_is_of_today(tmp_path, monkeypatch):
    path = tmp_path / "accuracy.json"
    path.write_text('{"fingerprint": "bbbbbbbb"}')
    for module in (driver, reports):
        monkeypatch.setattr(module, "reported", lambda: ["accuracy"])
    monkeypatch.setattr(driver, "headline", lambda: ["accuracy"])
    monkeypatch.setattr(reports, "report_path", lambda name: path)
    monkeypatch.setattr(reports, "ids_of_today", lambda: {"perception": "aaaaaaaa", "estimates": "bbbbbbbb"})
    (first,) = driver.plan(["accuracy"])
    assert first.state == "today"


def test_headline_reports_come_first_and_say_what_they_are_of(monkeypatch):
    monkeypatch.setattr(driver, "headline", lambda: ["kidnap", "identify"])
    steps = driver.plan()
    assert [each.name for each in steps if each.headline] == [each.name for each in steps[:2]] == ["kidnap", "identify"]
    assert {each.name for each in steps} == set(reports.COMMANDS) - set(reports.NO_ESTIMATES)
