"""Strangers' pickles: data comes through, programs do not."""

import builtins
import collections
import contextlib
import copyreg
import os
import pickle
import struct
import subprocess
import sys
import types
import typing
from pathlib import Path

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_tools.datasets import restricted_pickle

ARRAYS = [
    np.arange(12.0).reshape(3, 4),
    np.asfortranarray(np.arange(12, dtype=np.int16).reshape(3, 4)),
    np.arange(6, dtype=">f4"),
    np.array([True, False]),
    np.array(["a", "longer"]),
    np.array([b"raw", b"bytes"]),
    np.zeros((0, 7)),
    np.array(3.5),
    np.array([1 + 2j]),
]


@pytest.mark.parametrize("protocol", range(2, 6))
@pytest.mark.parametrize("array", ARRAYS, ids=lambda a: f"{a.dtype}-{a.shape}")
def test_arrays_come_through_every_protocol(array, protocol):
    loaded = restricted_pickle.loads(pickle.dumps({"a": array, "again": [array]}, protocol), "x")
    np.testing.assert_array_equal(loaded["a"], array)
    assert loaded["a"].dtype.newbyteorder("=") == array.dtype.newbyteorder("=")
    assert loaded["again"][0] is loaded["a"]
    assert loaded["a"].flags.writeable


@pytest.mark.parametrize("protocol", [2, 4, 5])
def test_scalars_containers_and_object_arrays(protocol):
    value = {
        "scalar": np.float64(0.25),
        "int": np.int32(-3),
        "tuple": (1, 2.5, "text", None, True, b"raw", b""),
        "objects": np.array([{"x": np.arange(3)}, None], dtype=object),
    }
    loaded = restricted_pickle.loads(pickle.dumps(value, protocol), "x")
    assert loaded["scalar"] == 0.25
    assert loaded["int"] == -3
    assert loaded["tuple"] == value["tuple"]
    np.testing.assert_array_equal(loaded["objects"][0]["x"], np.arange(3))


def test_both_generations_of_numpy_paths():
    of_numpy_1, of_numpy_2 = b"numpy.core.multiarray", b"numpy._core.multiarray"
    old = pickle.dumps(np.arange(3.0), 2).replace(of_numpy_2, of_numpy_1)
    new = old.replace(of_numpy_1, of_numpy_2)
    assert old != new
    np.testing.assert_array_equal(restricted_pickle.loads(old, "x"), np.arange(3.0))
    np.testing.assert_array_equal(restricted_pickle.loads(new, "x"), np.arange(3.0))


def omegaconf(monkeypatch) -> dict:
    """Values of classes that pickle as those of OmegaConf 2.2, for {"sig_t": 5e-4, "steps": [1]}."""

    def kind(module: str, name: str):
        made = type(name, (types.SimpleNamespace,), {"__module__": f"omegaconf.{module}", "__reduce__": _by_state})
        monkeypatch.setitem(sys.modules, f"omegaconf.{module}", types.SimpleNamespace(**{name: made}))
        return made

    monkeypatch.setitem(sys.modules, "omegaconf", types.ModuleType("omegaconf"))
    node, metadata = kind("nodes", "AnyNode"), kind("base", "ContainerMetadata")
    container, items = kind("dictconfig", "DictConfig"), kind("listconfig", "ListConfig")
    about = metadata(object_type=dict, ref_type=typing.Any, resolver_cache=collections.defaultdict(dict))
    content = {"sig_t": node(_parent=None, _val=5e-4), "steps": items(_content=[node(_val=1)])}
    return {"mNoise": container(_metadata=about, _content=content)}


def _by_state(value):
    return copyreg.__newobj__, (type(value),), vars(value)


@pytest.mark.parametrize("protocol", [2, 4])
def test_omegaconf_nodes_are_skipped_and_data_beside_them_read(monkeypatch, protocol):
    data = pickle.dumps({**omegaconf(monkeypatch), "n": 5}, protocol)
    assert data.count(b"AnyNode") == 1
    assert restricted_pickle.loads(data, "x")["n"] == 5


class Calls:
    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize(
    ("function", "arguments", "name"),
    [
        (os.system, ("touch {marker}",), "system"),
        (builtins.eval, ("open('{marker}', 'w')",), "eval"),
        (builtins.exec, ("open('{marker}', 'w')",), "exec"),
        (builtins.getattr, ("", "join"), "getattr"),
        (subprocess.Popen, (["touch", "{marker}"],), "Popen"),
        (np.load, ("{marker}",), "numpy.load"),
        (np.fromfile, ("{marker}",), "fromfile"),
        (collections.OrderedDict, (), "collections.OrderedDict"),
    ],
)
@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_foreign_functions_are_refused_by_name_and_never_run(tmp_path, function, arguments, name, protocol):
    marker = tmp_path / "ran"
    arguments = tuple(
        [part.format(marker=marker) for part in a] if isinstance(a, list) else a.format(marker=marker)
        for a in arguments
    )
    data = pickle.dumps({"gelposes": np.zeros(3), "evil": Calls(function, *arguments)}, protocol)
    with pytest.raises(InputError, match=name):
        restricted_pickle.loads(data, "some.pkl")
    assert not marker.exists()


def named(module: str, name: str) -> bytes:
    """The beginning of a pickle that asks for a name."""
    texts = (b"X" + struct.pack("<I", len(text)) + text.encode() for text in (module, name))
    return b"\x80\x04" + b"".join(texts) + b"\x93"


@pytest.mark.parametrize("what", [("numpy", "ndarray"), ("numpy._core.multiarray", "_reconstruct")])
def test_an_array_is_as_large_as_its_content_not_as_it_claims(what):
    called = named(*what) + b"(J" + struct.pack("<i", 2**31 - 1) + b"tR."
    assert np.size(restricted_pickle.loads(called, "x")) == 0


@pytest.mark.parametrize("what", [("numpy", "ndarray"), ("numpy._core.multiarray", "scalar"), ("_codecs", "encode")])
def test_attributes_set_by_a_pickle_do_no_harm(what):
    attribute = b"X" + struct.pack("<I", 12) + b"__defaults__"
    with contextlib.suppress(InputError):
        restricted_pickle.loads(named(*what) + b"N}(" + attribute + b"K\x01u\x86b.", "x")
    value = [np.arange(3.0), np.float64(2), b"raw"]
    for loaded, true in zip(restricted_pickle.loads(pickle.dumps(value, 2), "x"), value, strict=True):
        np.testing.assert_array_equal(loaded, true)


def test_every_truncation_is_refused_with_one_kind_of_error():
    data = pickle.dumps({"gelposes": np.zeros((2, 7)), "mNoise": {"sig_t": 5e-4}}, 4)
    for end in range(len(data)):
        with pytest.raises(InputError, match=r"some\.pkl"):
            restricted_pickle.loads(data[:end], "some.pkl")


def test_damaged_bytes_never_raise_anything_else():
    rng = np.random.default_rng(0)
    data = bytearray(pickle.dumps({"gelposes": np.zeros((2, 7)), "n": np.float32(1)}, 4))
    refused = 0
    for _ in range(500):
        damaged = bytearray(data)
        for position in rng.integers(0, len(data), 3):
            damaged[position] = rng.integers(256)
        try:
            restricted_pickle.loads(bytes(damaged), "x")
        except InputError:
            refused += 1
    assert refused > 100


EIGHT = pickle.dumps(np.zeros(8), 4)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x80\x04\x8c\x05numpy\x8c\x0fndarray.__new__\x93.", "__new__"),  # through a module that is allowed
        # the shape (8,) is the only tuple of one small integer in this pickle
        (EIGHT.replace(b"K\x08\x85", b"K\xff\x85"), "shape"),
        (EIGHT[:-1] + b"\x98.", "buffer"),  # a view of the array's memory
        (pickle.dumps(np.zeros(2, "datetime64[s]"), 4), "neither plain numbers nor text"),
        (pickle.dumps(np.zeros(2, [("a", "f8")]), 4), "neither plain numbers nor text"),
        (pickle.dumps(np.zeros(2, "V4"), 4), "neither plain numbers nor text"),
        # before memory is taken
        (b"\x80\x02]r" + struct.pack("<I", 2**32 - 1) + b".", "memo slot"),
        (b"\x80\x02]p4294967295\n.", "memo slot"),
    ],
)
def test_crafted_pickles_are_refused(data, reason):
    assert data != EIGHT
    with pytest.raises(InputError, match=f"x: .*{reason}"):
        restricted_pickle.loads(data, "x")


def test_lists_within_lists_stay_the_same_objects():
    exploding, own = [], []
    for _ in range(60):
        exploding = [exploding, exploding]
    own.append(own)
    loaded = restricted_pickle.loads(pickle.dumps([exploding, own]), "x")
    assert loaded[0][0] is loaded[0][1]
    assert loaded[1][0] is loaded[1]


def test_npy_files_plain_and_pickled(tmp_path):
    plain, pickled = tmp_path / "plain.npy", tmp_path / "pickled.npy"
    np.save(plain, np.eye(4))
    np.save(pickled, {"poses": {"DIGIT": np.ones((2, 7))}}, allow_pickle=True)
    np.testing.assert_array_equal(restricted_pickle.load_npy(plain), np.eye(4))
    np.testing.assert_array_equal(restricted_pickle.load_npy(pickled)["poses"]["DIGIT"], np.ones((2, 7)))
    np.save(pickled, np.array([1, "two"], dtype=object), allow_pickle=True)
    assert restricted_pickle.load_npy(pickled).tolist() == [1, "two"]


def test_npy_with_a_program_inside_is_refused(tmp_path):
    path = tmp_path / "evil.npy"
    np.save(path, np.array({"x": Calls(os.system, "true")}, dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match="system"):
        restricted_pickle.load_npy(path)


def npy(header: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"text",
        npy("{'descr': bad}"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': ((4, 4), }"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000, 4, 4)}"),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 4, 4)}"),
    ],
)
def test_npy_that_is_none_is_refused(tmp_path, content):
    path = tmp_path / "bad.npy"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.npy"):
        restricted_pickle.load_npy(path)


def test_missing_file_is_named():
    with pytest.raises(InputError, match=r"nowhere\.pkl"):
        restricted_pickle.load(Path("nowhere.pkl"))
