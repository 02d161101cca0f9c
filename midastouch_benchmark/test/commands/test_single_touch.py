import pytest

from midastouch_tools import cli


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give mesh files"),
        (["a.ply", "b.ply", "--codebook", "a.npz"], "a.npz: "),
        (["eyebolt"], "midastouch build-codebook eyebolt"),
        (["eyebolt", "--codebook", "."], "eyebolt.npz"),
        (["--mesh", "eyebolt"], "eyebolt.npz"),
        (["eyebolt", "--backgrounds", "."], "no-contact images"),
    ],
)
def test_what_cannot_be_measured_is_said_at_once(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["single-touch", *arguments]) == cli.EXIT_BAD_INPUT
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
