import argparse
import math
import time

import pytest

from midastouch_benchmark.commands import campaigns
from midastouch_common.errors import InputError


def options(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    campaigns.add_campaign_options(parser, "trial")
    return parser.parse_args(["--jobs", "1", *given])


def test_the_deadline_is_counted_from_the_start():
    with campaigns.campaign(options(), "trial") as workforce:
        assert workforce.deadline == math.inf
    before = time.monotonic()
    with campaigns.campaign(options("--minutes", "2"), "trial") as workforce:
        progress = workforce.start_progress(2)
        for number, square in enumerate(workforce.cluster.map(pow, [(1, 2), (3, 2)], workforce.deadline)):
            assert square == (2 * number + 1) ** 2
            progress(1)
    assert before + 120 <= workforce.deadline <= time.monotonic() + 120


def test_it_is_said_how_it_goes_on():
    assert campaigns.left(0, "trial") == []
    assert campaigns.left(3, "slide") == ["3 slides are left; the same command goes on with them"]


def test_objects_are_named_by_how_they_begin():
    assert [mesh.name for mesh in campaigns.chosen_meshes(None, ["eye", "ball"])] == ["eyebolt", "ball"]
    with pytest.raises(InputError, match=r"no object 'cup': there are ball, .*; give its name with --objects"):
        campaigns.chosen_meshes(None, ["cup"])
    with pytest.raises(InputError, match="nowhere: no such folder"):
        campaigns.chosen_meshes("nowhere", None)
