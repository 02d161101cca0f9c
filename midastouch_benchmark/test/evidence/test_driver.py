"""Reports made again in their order, from where it was stopped."""

import json

import pytest

from midastouch_benchmark.evidence import driver
from midastouch_benchmark.evidence.driver import Step
from midastouch_benchmark.tables import reports

TODAY = {"perception": "aaaaaaaa", "estimates": "bbbbbbbb"}


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(driver, "ROOT", tmp_path)
    return tmp_path


def step(name: str, code: str, command: str = "midastouch benchmark") -> Step:
    return Step(name, f"{command} # {code}", True, "unknown", 600.0)


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
    assert driver.carry_out([step("a", "{}"), step("b", '{"missing_trials": 0}')], jobs=2, say=lambda _: None) == []
    assert sorted(path.name for path in root.glob("reports/*/*.json")) == ["a.json", "b.json", "c.json"]
    assert [path.name for path in earlier.iterdir()] == ["c.json"]
    assert set(driver.measured_seconds()) == {"a", "b"}


def test_after_a_report_with_missing_trials_nothing_follows(root, shell):
    said = []
    driver.carry_out([step("a", '{"missing_trials": 3}'), step("b", "{}")], jobs=1, say=said.append)
    assert not list(root.glob("reports/*/*.json"))
    assert (root / "ran").read_text() == "a\n"
    assert "about 20 min left" in said[0]
    assert "continues" in said[-1]


def test_a_command_that_fails_is_named_and_the_next_goes_on(root, monkeypatch):
    lines = iter(["exit 3", "echo {} > out/evidence/b.json"])
    monkeypatch.setattr(driver, "command_line", lambda *_: next(lines))
    said = []
    assert driver.carry_out([step("a", ""), step("b", "")], jobs=1, say=said.append) == ["a"]
    assert any("exit 3" in each for each in said)
    assert [path.name for path in root.glob("reports/*/*.json")] == ["b.json"]


def test_campaigns_are_shared_out_and_bounded(tmp_path):
    shared, alone = step("a", ""), step("b", "", "midastouch evaluate-perception tdn")
    assert driver.command_line(shared, tmp_path / "a", 2, 30).endswith(f" --jobs 2 --minutes 30.0 --json {tmp_path}/a")
    assert "--jobs" not in driver.command_line(alone, tmp_path / "b", 2, 30)
    prepared = driver.command_line(
        step("c", "", "midastouch simulate a && midastouch evaluate-perception tdn a"), tmp_path, 1, None
    )
    assert prepared.count(" -m midastouch_tools.cli ") == 2
    assert (shared.takes(2), alone.takes(2)) == (300, 600)


@pytest.mark.parametrize(("seconds", "words"), [(10, "1 min"), (3_000, "50 min"), (7_800, "2 h 10 min")])
def test_times_in_words(seconds, words):
    assert driver.in_words(seconds) == words


def test_headline_reports_come_first_and_say_what_they_are_of(monkeypatch):
    monkeypatch.setattr(driver, "headline", lambda: ["kidnap", "identify"])
    steps = driver.plan()
    assert [each.name for each in steps if each.headline] == [each.name for each in steps[:2]] == ["kidnap", "identify"]
    assert {each.name for each in steps} == set(reports.COMMANDS) - set(reports.NO_ESTIMATES)


def test_times_come_from_trials_and_then_from_experience(root, monkeypatch):
    content = {"fingerprint": "bbbbbbbb", "trials": [{"filter_cpu_ms": 10.0, "frames": 100}] * 200}
    path = root / "accuracy.json"
    path.write_text(json.dumps(content))
    for module in (driver, reports):
        monkeypatch.setattr(module, "reported", lambda: ["accuracy"])
    monkeypatch.setattr(driver, "headline", lambda: ["accuracy"])
    monkeypatch.setattr(reports, "report_path", lambda name: path)
    monkeypatch.setattr(reports, "ids_of_today", lambda: TODAY)
    (first,) = driver.plan(["accuracy"])
    assert (first.state, first.seconds) == ("today", pytest.approx(1.6 * 200))
    driver.remember_seconds("accuracy", 77.0)
    assert driver.plan(["accuracy"])[0].seconds == 77.0
