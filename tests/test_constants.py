"""docs/internals.md against the code: nothing missing, nothing gone, no other value."""

import inspect
import re
from pathlib import Path

import filter_constants
import numpy as np
import pytest
from scipy.stats import chi2

from midastouch_benchmark.trials import yardstick
from midastouch_filter import loaded_object
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.pose_hypothesis import ANOTHER, ANOTHER_TURN
from midastouch_perception.codebook import YAWS
from midastouch_perception.codebook_build import CodebookBuild

PAGE = Path(__file__).resolve().parent.parent / "docs" / "internals.md"
ORIGINS = {
    "paper",
    "literature",
    "derived",
    "fitted",
    "measured",
    "assumed",
    "bounds work",
    "by hand",
    "choice",
    "form",
}


def listed() -> dict[tuple[str, str], tuple[str, str]]:
    """(value, where it comes from) by file and name."""
    rows = re.findall(r"^\| `([^`]+)` \| `([^`]+)` \| `([^`]+)` \| [^|]+ \| ([^|]+) \|$", PAGE.read_text(), flags=re.M)
    assert len(rows) == len({row[:2] for row in rows})
    return {(file, name): (value, origin) for file, name, value, origin in rows}


def test_every_constant_of_the_filter_is_listed_with_its_value():
    page, code = {key: value for key, (value, _) in listed().items()}, filter_constants.constants()
    assert len(code) > 100
    assert set(code) - set(page) == set(), "list them in docs/internals.md, with where they come from"
    assert set(page) - set(code) == set(), "gone from the code: take them out of docs/internals.md"
    assert {key: value for key, value in page.items() if value != code[key]} == {}, "another value in the code"


def test_every_constant_says_where_it_comes_from():
    for key, (_, origin) in listed().items():
        assert origin.partition(":")[0].strip() in ORIGINS, key


def test_few_constants_are_chosen_by_hand():
    by_hand = [key for key, (_, origin) in listed().items() if origin.partition(":")[0].strip() == "by hand"]
    assert len(by_hand) <= 40, by_hand


def test_derived_values_follow_from_what_they_name():
    noise, between_turns = NoiseModel.of(FilterConfig()), 2 * np.pi / YAWS
    assert noise.elsewhere == pytest.approx(chi2.ppf(0.999, 6), rel=0.005)
    assert np.sqrt(noise.between_entries[5, 5]) == pytest.approx(between_turns / 2, rel=0.1)
    config, half_answer = FilterConfig(), ANOTHER / 2
    assert config.region_radius == half_answer
    assert (yardstick.DISTANCE, yardstick.ANGLE) == (ANOTHER, ANOTHER_TURN)
    assert config.dead_distance == pytest.approx(config.max_penetration + 4 * config.surface_sigma)
    between = np.sqrt(np.diag(noise.between_entries))
    assert (config.refine_translation, config.refine_rotation) == pytest.approx((2 * between[0], 2 * between[5]))
    assert inspect.signature(CodebookBuild).parameters["size"].default == loaded_object.DENSE
    assert Effort().turns == pytest.approx((between_turns / 2, between_turns / 4), rel=0.15)


def test_a_new_number_is_found(tmp_path, monkeypatch):
    source = "A, B = 0.5, -2\nC: float = np.radians(3.0)\nNAME = 'text'\nON = True\nBOX = Box(3)\n"
    (tmp_path / "new.py").write_text(source)
    (tmp_path / "core").mkdir()
    effort = "class Effort:\n    starts: int = 4\n    turns: tuple = (np.radians(10.0),)\n"
    (tmp_path / "core" / "noise_model.py").write_text(effort)
    monkeypatch.setattr(filter_constants, "ROOT", tmp_path)
    assert filter_constants.constants() == {
        ("new.py", "A"): "0.5", ("new.py", "B"): "-2", ("new.py", "C"): "np.radians(3.0)",
        ("core/noise_model.py", "starts"): "4", ("core/noise_model.py", "turns"): "(np.radians(10.0),)",
    }  # fmt: skip
