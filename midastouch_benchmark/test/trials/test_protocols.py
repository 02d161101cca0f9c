import pytest

from midastouch_benchmark.trials.protocols import PROTOCOLS, chosen_protocol
from midastouch_bringup.cli import build_parser
from midastouch_common.errors import InputError


def test_help_names_every_protocol(capsys):
    with pytest.raises(SystemExit):
        build_parser().parse_args(["benchmark", "--help"])
    listed = capsys.readouterr().out.partition("--protocol takes one of:")[2].split()
    assert set(PROTOCOLS) <= set(listed)


def test_an_unknown_one_is_refused():
    with pytest.raises(InputError, match="--protocol stormy: not known; there are plain, uniform"):
        chosen_protocol("stormy")


@pytest.mark.parametrize("name", ["lift", "kidnap", "jump"])
def test_what_needs_a_leap_has_one(name):
    assert PROTOCOLS[name].slides.leap is not None
