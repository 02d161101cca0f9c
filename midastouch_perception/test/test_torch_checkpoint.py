"""Checkpoints made by hand, byte by byte, and, where PyTorch is at hand, by `torch.save`."""

import io
import pickle
import zipfile
from collections import OrderedDict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midastouch_common.errors import InputError
from midastouch_perception.checkpoint import read_checkpoint

BLOCK = np.arange(12, dtype="<f4")


class Name:
    """Pickled as a reference to a global of that module and name."""

    def __init__(self, module: str, name: str):
        self.parts = module, name


class Tensor:
    """Pickled as PyTorch pickles a tensor."""

    def __init__(self, key="0", shape=(3, 4), stride=(4, 1), offset=0, count=12, storage="FloatStorage"):
        self.storage = ("storage", Name("torch", storage), key, "cpu", count)
        self.rest = (offset, shape, stride, False, OrderedDict())


class Pickler(pickle._Pickler):
    """Writes `Name` and `Tensor` as the classes of a library that is not installed."""

    def persistent_id(self, obj):
        return obj if isinstance(obj, tuple) and obj and obj[0] == "storage" else None

    def save(self, obj, save_persistent_id=True):
        if isinstance(obj, Name):
            module, name = obj.parts
            self.write(pickle.GLOBAL + f"{module}\n{name}\n".encode())
        elif isinstance(obj, Tensor):
            self.save(Name("torch._utils", "_rebuild_tensor_v2"))
            self.save((obj.storage, *obj.rest))
            self.write(pickle.REDUCE)
        else:
            super().save(obj, save_persistent_id)


def pickled(content: object) -> bytes:
    stream = io.BytesIO()
    Pickler(stream, protocol=2).dump(content)
    return stream.getvalue()


def zipped(content: object, blocks=None, compression=zipfile.ZIP_STORED, byteorder=b"little") -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        archive.writestr("archive/data.pkl", content if isinstance(content, bytes) else pickled(content))
        archive.writestr("archive/byteorder", byteorder)
        for key, block in (blocks or {"0": BLOCK.tobytes()}).items():
            archive.writestr(f"archive/data/{key}", block)
        archive.writestr("archive/version", b"3\n")
    return stream.getvalue()


def read(data: bytes, tmp_path) -> dict[str, np.ndarray]:
    path = tmp_path / "net.pth.tar"
    path.write_bytes(data)
    return read_checkpoint(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("checkpoints")


@pytest.mark.parametrize("state_key", [None, "state_dict", "model_state_dict"])
def test_tensors_share_and_stride_their_blocks(tmp_path, state_key):
    state = {
        "whole": Tensor(),
        "transposed": Tensor(shape=(4, 3), stride=(1, 4)),
        "window": Tensor(shape=(2, 2), offset=5),
        "scalar": Tensor(shape=(), stride=(), offset=7),
        "empty": Tensor(shape=(0, 4)),
    }
    content = {"epoch": 3, state_key: state, "optimizer": {"param_groups": [{"lr": 1e-4}]}} if state_key else state
    got = read(zipped(content), tmp_path)
    whole = BLOCK.reshape(3, 4)
    expected = {"whole": whole, "transposed": whole.T, "window": whole[1:, 1:3], "scalar": 7, "empty": np.empty((0, 4))}
    assert got.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(got[name], values)


@pytest.mark.parametrize(
    ("storage", "block"),
    [
        ("DoubleStorage", np.array([0.1, -2])),
        ("HalfStorage", np.array([0.1, -2], np.float16)),
        ("LongStorage", np.array([2**40, -1])),
        ("BoolStorage", np.array([True, False])),
    ],
)
def test_types(tmp_path, storage, block):
    content = {"x": Tensor(shape=(2,), stride=(1,), count=2, storage=storage)}
    got = read(zipped(content, {"0": block.tobytes()}), tmp_path)["x"]
    np.testing.assert_array_equal(got, block)
    assert got.dtype == block.dtype


def test_bfloat16_is_the_upper_half_of_float32(tmp_path):
    exact = np.array([1.5, -0.15625], "<f4")
    content = {"x": Tensor(shape=(2,), stride=(1,), count=2, storage="BFloat16Storage")}
    got = read(zipped(content, {"0": (exact.view("<u4") >> 16).astype("<u2").tobytes()}), tmp_path)["x"]
    np.testing.assert_array_equal(got, exact)


@pytest.mark.parametrize("module", ["os", "builtins", "torch.nn.modules.conv"])
def test_foreign_classes_are_named_and_refused(tmp_path, module):
    with pytest.raises(InputError, match=rf"net.pth.tar: asks for '{module}.system', but only tensors are read"):
        read(zipped({"x": Name(module, "system")}), tmp_path)


@pytest.mark.parametrize(
    "tensor",
    [
        Tensor(shape=(3, 5)),
        Tensor(offset=1),
        Tensor(offset=-1),
        Tensor(shape=(3, 4), stride=(-4, 1)),
        Tensor(shape=(10**9, 10**9), stride=(0, 0)),
        Tensor(shape=(3,)),
        Tensor(count=13),
        Tensor(key="1"),
        Tensor(shape=("a", 4)),
    ],
)
def test_tensors_that_leave_their_block_are_refused(tmp_path, tensor):
    with pytest.raises(InputError, match=r"net.pth.tar: "):
        read(zipped({"x": tensor}), tmp_path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ([1, 2], "holds a list, not a state dict"),
        ({"epoch": 3}, "holds no state dict, only epoch"),
        ({}, "holds no state dict, only nothing"),
    ],
)
def test_files_without_tensors_say_what_they_hold(tmp_path, content, reason):
    with pytest.raises(InputError, match=rf"net.pth.tar: {reason}"):
        read(zipped(content), tmp_path)


def test_compressed_blocks_are_refused(tmp_path):
    with pytest.raises(InputError, match="is compressed"):
        read(zipped({"x": Tensor()}, compression=zipfile.ZIP_DEFLATED), tmp_path)


def test_big_endian_is_refused(tmp_path):
    with pytest.raises(InputError, match="big-endian"):
        read(zipped({"x": Tensor()}, byteorder=b"big"), tmp_path)


def test_a_claimed_memo_of_gigabytes_is_refused(tmp_path):
    with pytest.raises(InputError, match="memo slot"):
        read(zipped(b"\x80\x02}r\xff\xff\xff\xff."), tmp_path)


def test_the_format_before_the_archive_is_refused_with_the_mend(tmp_path):
    with pytest.raises(InputError, match=r"net.pth.tar: a pickle, such as PyTorch before 1.6 wrote; save it again"):
        read(pickled(0x1950A86A20F9469CFC6C), tmp_path)


def test_a_file_cut_anywhere_is_one_clear_error(tmp_path):
    whole = zipped({"x": Tensor()})
    for length in range(0, len(whole), 7):
        with pytest.raises(InputError, match=r"net.pth.tar: "):
            read(whole[:length], tmp_path)


@given(st.data())
def test_a_damaged_file_never_ends_in_another_error(folder, data):
    damaged = bytearray(zipped({"state_dict": {"x": Tensor()}}))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        state = read(bytes(damaged), folder)
    except InputError:
        return
    assert all(isinstance(values, np.ndarray) for values in state.values())


def test_files_of_torch_read_as_torch_reads_them(tmp_path):
    torch = pytest.importorskip("torch", reason="PyTorch is in the [train] extra")
    model = torch.nn.DataParallel(torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.BatchNorm2d(4)))
    optimizer = torch.optim.Adam(model.parameters())
    sum(p.sum() for p in model.parameters()).backward()
    optimizer.step()
    state = model.state_dict()
    base = torch.randn(5, 6)
    state |= {"transposed": base.t(), "window": base[1:3, 2:4], "half": base.half(), "brain": base.bfloat16()}
    state |= {"parameter": torch.nn.Parameter(base), "whole": torch.arange(4), "scalar": torch.tensor(2.5)}
    path = tmp_path / "net.pth.tar"
    content = {"epoch": 1, "state_dict": state, "optimizer": optimizer.state_dict()}
    torch.save(content, path)
    expected = torch.load(path, weights_only=True)["state_dict"]
    got = read_checkpoint(path)
    assert list(got) == list(expected)
    for name, values in expected.items():
        values = values.detach().float() if values.dtype == torch.bfloat16 else values.detach()
        np.testing.assert_array_equal(got[name], values.numpy())
