import json

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.checkpoint import read_checkpoint

STATE = {
    "weight": np.arange(6, dtype=np.float32).reshape(2, 3),
    "half": np.array([1.5, -2], np.float16),
    "count": np.array(7, np.int64),
}


def equal(got: dict, expected: dict) -> bool:
    return got.keys() == expected.keys() and all(np.array_equal(got[k], v) for k, v in expected.items())


def safetensors(state: dict[str, np.ndarray], **changes: object) -> bytes:
    """The format by its specification; `changes` to the entry of "weight"."""
    names = {"float32": "F32", "float16": "F16", "int64": "I64"}
    header, content = {"__metadata__": {"format": "pt"}}, b""
    for name, values in state.items():
        offsets = [len(content), len(content) + values.nbytes]
        header[name] = {"dtype": names[values.dtype.name], "shape": list(values.shape), "data_offsets": offsets}
        content += values.tobytes()
    header["weight"] |= changes
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + content


def test_numpy_archive(tmp_path):
    np.savez(tmp_path / "net.npz", **STATE)
    assert equal(read_checkpoint(tmp_path / "net.npz"), STATE)


def test_safetensors(tmp_path):
    path = tmp_path / "net.safetensors"
    path.write_bytes(safetensors(STATE))
    assert equal(read_checkpoint(path), STATE)


@pytest.mark.parametrize(
    "changes",
    [{"data_offsets": [0, 10**9]}, {"shape": [2, 4]}, {"shape": [-2, -3]}, {"dtype": "Q8"}, {"data_offsets": [9, 1]}],
)
def test_inconsistent_safetensors_are_refused(tmp_path, changes):
    path = tmp_path / "net.safetensors"
    path.write_bytes(safetensors(STATE, **changes))
    with pytest.raises(InputError, match=r"net.safetensors: not a complete .safetensors file .* get it again"):
        read_checkpoint(path)


@pytest.mark.parametrize("length", [0, 5, 9, 40, 200, -1])
def test_cut_safetensors_are_refused(tmp_path, length):
    path = tmp_path / "net.safetensors"
    path.write_bytes(safetensors(STATE)[:length])
    with pytest.raises(InputError, match=r"net.safetensors: "):
        read_checkpoint(path)


@pytest.mark.parametrize("length", [10, 200, -1])
def test_a_cut_archive_is_refused(tmp_path, length):
    np.savez(tmp_path / "net.npz", **STATE)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "net.npz").read_bytes()[:length])
    with pytest.raises(InputError, match=r"cut.npz: not a complete checkpoint .* download it again"):
        read_checkpoint(tmp_path / "cut.npz")


def test_pickled_arrays_are_refused(tmp_path):
    np.savez(tmp_path / "net.npz", weight=np.array([{}], object))
    with pytest.raises(InputError, match=r"net.npz: "):
        read_checkpoint(tmp_path / "net.npz")


def test_a_web_page_saved_as_a_checkpoint_is_told(tmp_path):
    path = tmp_path / "tcn_weights.pth.tar"
    path.write_text("<!DOCTYPE html><html><head><title>Virus scan warning</title>")
    with pytest.raises(InputError, match=r"begins with b'<!DOCTYPE', not a PyTorch checkpoint.*download it again"):
        read_checkpoint(path)


@pytest.mark.parametrize("name", ["missing.pth", "."])
def test_no_file(tmp_path, name):
    with pytest.raises(InputError, match="no such weight file"):
        read_checkpoint(tmp_path / name)
