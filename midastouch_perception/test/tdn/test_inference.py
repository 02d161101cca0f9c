"""Our depth network: chosen by the sensor's light, and its bottleneck as a second output of networks of one layer."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper, numpy_helper

from midastouch_perception.onnx_network import WEIGHTS
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn


def write_network(path: Path, with_embedding: bool) -> None:
    """Penetration 0.5 x red, contact where green > 0; embedding: mean colour of the difference, as a unit vector."""
    weight = np.array([[0.5, 0, 0], [0, 1, 0]], np.float32).reshape(2, 3, 1, 1)
    shapes = {"penetration_contact": ("batch", 2, 160, 120)}
    nodes = [helper.make_node("Conv", ["difference", "weight"], ["penetration_contact"])]
    if with_embedding:
        shapes["embedding"] = ("batch", 3)
        nodes += [
            helper.make_node("GlobalAveragePool", ["difference"], ["mean"]),
            helper.make_node("Flatten", ["mean"], ["flat"], axis=1),
            helper.make_node("LpNormalization", ["flat"], ["embedding"], axis=1, p=2),
        ]
    inputs, outputs = (
        [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape) for name, shape in each.items()]
        for each in (dict.fromkeys(("difference", "geometry"), ("batch", 3, 160, 120)), shapes)
    )
    graph = helper.make_graph(nodes, "tiny", inputs, outputs, [numpy_helper.from_array(weight, "weight")])
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)
    card = json.loads((WEIGHTS / "tdn_fast.json").read_text())
    del card["sha256"]  # of another network
    path.with_suffix(".json").write_text(json.dumps(card))


@pytest.fixture
def differences() -> np.ndarray:
    colours = np.array([[64, 32, 0], [0, -32, 32]], np.float32)  # grey levels: 32 of them are 1 to the network
    return np.broadcast_to(colours[:, None, None], (2, 160, 120, 3))


def test_a_second_output_changes_no_other(tmp_path, differences):
    both, alone = tmp_path / "both.onnx", tmp_path / "alone.onnx"
    write_network(both, with_embedding=True)
    write_network(alone, with_embedding=False)
    maps = load_tdn(both).penetration(differences)
    np.testing.assert_array_equal(load_tdn(alone).penetration(differences), maps)
    assert maps[0] == pytest.approx(1e-3)
    assert not maps[1].any()


def test_the_sensor_s_light_chooses_the_network():
    assert load_tdn("fast").network_id.startswith("tdn_fast-")
    assert load_tdn("fast", SensorModel.load("digit_real")).network_id.startswith("tdn_fast_relative-")
