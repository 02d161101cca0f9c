import numpy as np
import pytest

from midastouch_perception.npz_map import mapped_npz


def test_arrays_are_those_of_the_file_and_lie_on_the_disk(tmp_path):
    arrays = {
        "flat": np.arange(12, dtype=np.float16),
        "table": np.arange(12.0).reshape(3, 4),
        "by_columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "word": np.array("words"),
        "none": np.zeros((0, 7)),
    }
    np.savez(tmp_path / "some.npz", **arrays)
    found = mapped_npz(tmp_path / "some.npz")
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)
    assert isinstance(found["table"], np.memmap)
    with pytest.raises(ValueError, match="read-only"):
        found["table"][0] = 1.0


def test_what_cannot_be_mapped_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "small.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match=r"a\.npy is compressed"):
        mapped_npz(tmp_path / "small.npz")
    np.savez(tmp_path / "objects.npz", a=np.array([{}], object))
    with pytest.raises(ValueError, match="holds objects"):
        mapped_npz(tmp_path / "objects.npz")
