from midastouch_bringup import cli
from midastouch_bringup.commands import doctor


def test_a_complete_installation_is_ready(capsys):
    assert cli.main(["doctor"]) == 0
    output = capsys.readouterr().out
    assert "ready: midastouch demo" in output
    assert "MISSING" not in output


def test_a_missing_part_is_named_with_its_fix(monkeypatch, capsys):
    parts = (("no_such_module", "no-such", "nothing", True, "make setup"), *doctor.MODULES[:2])
    monkeypatch.setattr(doctor, "MODULES", parts)
    assert cli.main(["doctor"]) == 1
    output = capsys.readouterr().out
    assert "no-such: ModuleNotFoundError" in output
    assert "fix: make setup" in output


def test_optional_parts_may_be_absent(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "MODULES", (("no_such_module", "no-such", "nothing", False, "pip"),))
    assert cli.main(["doctor"]) == 0
    assert "if wanted: pip" in capsys.readouterr().out
