import pytest

from midastouch_bringup import cli
from midastouch_bringup.commands import doctor


@pytest.fixture
def without_networks(monkeypatch):
    monkeypatch.setattr(doctor, "_network_row", lambda mends: ["weights", "shipped networks", "here"])


def test_a_complete_installation_is_ready(without_networks, capsys):
    assert cli.main(["doctor"]) == 0
    output = capsys.readouterr().out
    assert "ready: midastouch demo" in output
    assert "MISSING" not in output


def test_a_missing_part_is_named_with_its_mend(without_networks, monkeypatch, capsys):
    parts = (("no_such_module", "no-such", "nothing", True, "make setup"), *doctor._MODULES[:2])
    monkeypatch.setattr(doctor, "_MODULES", parts)
    assert cli.main(["doctor"]) == 1
    output = capsys.readouterr().out
    assert "no-such: ModuleNotFoundError" in output
    assert "mend: make setup" in output


def test_optional_parts_may_be_absent(without_networks, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "_MODULES", (("no_such_module", "no-such", "nothing", False, "pip"),))
    assert cli.main(["doctor"]) == 0
    assert "if wanted: pip" in capsys.readouterr().out
