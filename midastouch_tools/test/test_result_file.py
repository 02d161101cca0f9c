import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_tools.result_file import read_json, write_json


def test_numpy_and_non_finite_values_become_plain_json(tmp_path):
    value = {"a": np.float32(1.5), "b": np.arange(3), "c": float("nan"), "d": (np.bool_(True), np.inf), 5: None}
    write_json(tmp_path / "r.json", value)
    assert read_json(tmp_path / "r.json") == {"a": 1.5, "b": [0, 1, 2], "c": None, "d": [True, None], "5": None}


def test_a_failing_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "r.json"
    write_json(path, {"old": 1})
    with pytest.raises(TypeError):
        write_json(path, {"new": object()})
    assert read_json(path) == {"old": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["r.json"]


@pytest.mark.parametrize("content", ["{", "[1, 2]", '{"a": NaN}', '{"a": 1e400}', "\x00\xff", 5000 * "[", 5000 * "1"])
def test_what_is_no_result_is_refused_by_name(tmp_path, content):
    path = tmp_path / "bad.json"
    path.write_bytes(content.encode("latin1"))
    with pytest.raises(InputError, match=r"bad\.json"):
        read_json(path)


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no such result file"):
        read_json(tmp_path / "none.json")
