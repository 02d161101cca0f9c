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
from midastouch_filter.active_touch.suggestion import CLEARANCE
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.pose_difference import ANOTHER, ANOTHER_TURN
from midastouch_perception.codebook import YAWS
from midastouch_perception.codebook_build import CodebookBuild

PAGE = Path(__file__).resolve().parent.parent / "docs" / "internals.md"
ORIGINS = {
    "paper", "literature", "derived", "fitted", "measured", "assumed", "bounds work", "by hand", "choice", "form",
}  # fmt: skip


def listed() -> dict[tuple[str, str], tuple[str, str]]:
    """(value, where it comes from) by file and name; a file is named once for the rows below it."""
    found, last = {}, ""
    row = r"^\| (?:`([^`]+)` )?\| `([^`]+)` \| `([^`]+)` \| (?:([^|]+) )?\| ([^|]+) \|$"
    for file, name, value, meaning, origin in re.findall(row, PAGE.read_text(), flags=re.M):
        last = file or last
        assert (last, name) not in found
        assert meaning or last == "core/config.py", f"{last}: {name} has no meaning"
        found[last, name] = value, origin
    return found


def number(file: str, name: str) -> float:
    """A constant's value."""
    return eval(filter_constants.constants()[file, name], {"np": np})


def test_every_constant_of_the_filter_is_listed_with_its_value():
    page, code = {key: value for key, (value, _) in listed().items()}, filter_constants.constants()
    assert len(code) > 100
    assert set(code) - set(page) == set(), "list them in docs/internals.md, with where they come from"
    assert set(page) - set(code) == set(), "gone from the code: take them out of docs/internals.md"
    assert {key: value for key, value in page.items() if value != code[key]} == {}, "another value in the code"


def test_every_constant_says_where_it_comes_from_few_by_hand():
    origins = {key: origin.partition(":")[0].strip() for key, (_, origin) in listed().items()}
    assert {key: origin for key, origin in origins.items() if origin not in ORIGINS} == {}
    by_hand = [key for key, origin in origins.items() if origin == "by hand"]
    assert len(by_hand) <= 20, by_hand


def test_derived_values_follow_from_what_they_name():
    noise, between_turns = NoiseModel.of(FilterConfig()), 2 * np.pi / YAWS
    assert noise.elsewhere == pytest.approx(chi2.ppf(0.999, 6), rel=0.005)
    assert np.sqrt(noise.between_entries[5, 5]) == pytest.approx(between_turns / 2, rel=0.1)
    assert (yardstick.DISTANCE, yardstick.ANGLE) == (ANOTHER, ANOTHER_TURN)
    narrow = [number("active_touch/hypotheses.py", name) for name in ("_NARROW", "_NARROW_TURN")]
    assert narrow == pytest.approx(2 * np.sqrt(np.diag(noise.between_entries)[[0, 5]]))
    assert number("core/track.py", "_LIFT") == CLEARANCE
    assert inspect.signature(CodebookBuild).parameters["size"].default == loaded_object.DENSE


def test_a_new_number_is_found(tmp_path, monkeypatch):
    source = "A, B = 0.5, -2\nC: float = np.radians(3.0)\nNAME = 'text'\nON = True\nBOX = Box(3)\n"
    (tmp_path / "new.py").write_text(source)
    (tmp_path / "core").mkdir()
    noise = "class NoiseModel:\n    patches: float = 4\n    turns: tuple = (np.radians(10.0),)\n"
    (tmp_path / "core" / "noise_model.py").write_text(noise)
    monkeypatch.setattr(filter_constants, "ROOT", tmp_path)
    assert filter_constants.constants() == {
        ("new.py", "A"): "0.5", ("new.py", "B"): "-2", ("new.py", "C"): "np.radians(3.0)",
        ("core/noise_model.py", "patches"): "4", ("core/noise_model.py", "turns"): "(np.radians(10.0),)",
    }  # fmt: skip
