import argparse
import json

from midastouch_benchmark.commands import outcome


def test_a_result_is_kept_with_the_command_that_made_it(tmp_path, capsys):
    parser = argparse.ArgumentParser()
    outcome.add_json_option(parser)
    args = parser.parse_args(["--json", str(tmp_path / "r.json")])
    args.command_line = "midastouch measure"
    assert outcome.conclude(args, {"mm": 1 / 3}, "a table", "a line") == 0
    assert capsys.readouterr().out == "a table\na line\n"
    assert json.loads((tmp_path / "r.json").read_text()) == {"command": "midastouch measure", "mm": 0.3333}


def test_it_is_shown_without_being_kept(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert outcome.conclude(argparse.Namespace(json=None), {}, "a table") == 0
    assert (capsys.readouterr().out, list(tmp_path.iterdir())) == ("a table\n", [])
