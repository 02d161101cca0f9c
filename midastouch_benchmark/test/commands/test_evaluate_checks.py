import json

import pytest

from midastouch_tools import cli


@pytest.mark.slow
def test_its_tables_show_what_its_json_holds(shared, tmp_path, capsys):
    told = tmp_path / "checks.json"
    backgrounds = str(shared / "data/digit_backgrounds")
    assert cli.main(["evaluate-checks", backgrounds, "--sensors", "1", "--json", str(told)]) == 0
    printed, result = capsys.readouterr().out, json.loads(told.read_text())
    assert set(result["fit_check"]) <= {line.split("  ")[0] for line in printed.splitlines()}
    assert len(result["ball_diameter"]["given"]) > 2
    assert "refused unless said to be right" in printed
