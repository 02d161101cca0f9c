"""The bottleneck as the network's second output, with networks of one layer written here byte by byte."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from midastouch_perception.onnx_network import WEIGHTS
from midastouch_perception.tdn import load_tdn


def field(number: int, value: int | bytes | str) -> bytes:
    """One protobuf field, of which ONNX files are made."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    content = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(content)) + content


def varint(value: int) -> bytes:
    low, rest = value & 0x7F, value >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def node(kind: str, inputs: list[str], output: str, **integers: int) -> bytes:
    attributes = [field(5, field(1, key) + field(3, value) + field(20, 2)) for key, value in integers.items()]
    content = b"".join(field(1, name) for name in inputs) + field(2, output) + field(4, kind) + b"".join(attributes)
    return field(1, content)


def tensor_info(number: int, name: str, shape: tuple) -> bytes:
    sizes = b"".join(field(1, field(2 if isinstance(size, str) else 1, size)) for size in shape)
    return field(number, field(1, name) + field(2, field(1, field(1, 1) + field(2, sizes))))


def write_network(path: Path, with_embedding: bool) -> None:
    """Penetration 0.5 x red, contact where green > 0; embedding: mean colour of the difference, as a unit vector."""
    weight = np.array([[0.5, 0, 0], [0, 1, 0]], np.float32)
    shape = b"".join(field(1, n) for n in (2, 3, 1, 1))
    nodes = [node("Conv", ["difference", "weight"], "penetration_contact")]
    outputs = [tensor_info(12, "penetration_contact", ("batch", 2, 160, 120))]
    if with_embedding:
        nodes += [
            node("GlobalAveragePool", ["difference"], "mean"),
            node("Flatten", ["mean"], "flat", axis=1),
            node("LpNormalization", ["flat"], "embedding", axis=1, p=2),
        ]
        outputs += [tensor_info(12, "embedding", ("batch", 3))]
    inputs = [tensor_info(11, name, ("batch", 3, 160, 120)) for name in ("difference", "geometry")]
    initialiser = field(5, shape + field(2, 1) + field(8, "weight") + field(9, weight.tobytes()))
    graph = b"".join(nodes) + field(2, "tiny") + initialiser + b"".join(inputs + outputs)
    path.write_bytes(field(1, 8) + field(7, graph) + field(8, field(2, 17)))
    shutil.copy(WEIGHTS / "tdn_fast.json", path.with_suffix(".json"))


@pytest.fixture
def differences() -> np.ndarray:
    colours = np.array([[64, 32, 0], [0, -32, 32]], np.float32)  # grey levels: 32 of them are 1 to the network
    return np.broadcast_to(colours[:, None, None], (2, 160, 120, 3))


def test_the_second_output_is_the_embedding(tmp_path, differences):
    write_network(tmp_path / "both.onnx", with_embedding=True)
    tdn = load_tdn(tmp_path / "both.onnx")
    assert tdn.has_embedding
    expected = np.array([[2, 1, 0], [0, -1, 1]]) / np.sqrt([[5], [2]])
    np.testing.assert_allclose(tdn.embedding(differences), expected, atol=1e-6)


def test_the_penetration_is_the_same_with_and_without_it(tmp_path, differences):
    maps = []
    for with_embedding in (True, False):
        path = tmp_path / f"{with_embedding}.onnx"
        write_network(path, with_embedding)
        maps.append(load_tdn(path).penetration(differences))
    np.testing.assert_array_equal(maps[0], maps[1])
    assert maps[0][0] == pytest.approx(1e-3)
    assert not maps[0][1].any()


def test_a_network_without_it_says_so(tmp_path):
    write_network(tmp_path / "one.onnx", with_embedding=False)
    assert not load_tdn(tmp_path / "one.onnx").has_embedding
