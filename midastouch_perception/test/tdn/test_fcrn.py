"""FCRN: against the official network's output where it is at hand, and its unusual part against its definition."""

import json

import numpy as np
import onnx
import onnxruntime
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.tdn.fcrn import HEIGHT_UNIT, NORM, QUARTERS, FcrnDepthNet, expected_shapes
from midastouch_perception.tdn.fcrn_graph import Graph, fcrn_model


def formula_state() -> dict[str, np.ndarray]:
    """The weights for which the reference output was made."""
    state = {}
    for j, (name, shape) in enumerate(sorted(expected_shapes().items())):
        i = np.arange(np.prod(shape))
        if name.endswith(("running_mean", "running_var")):
            values = np.full(len(i), float(name.endswith("running_var")))
        elif len(shape) == 4:
            values = np.sin(0.1 * i + j) * np.sqrt(2 / np.prod(shape[1:]))
        elif name.endswith("weight"):
            values = np.full(len(i), 0.9)
        else:
            values = 0.01 * np.sin(0.1 * i + j)
        state[name] = values.reshape(shape).astype(np.float32)
    return state


class FixedHeight:
    """In place of a trained network: its output, whatever the image."""

    network_id = "tdn_fixed-000000000000"

    def __init__(self, height: np.ndarray):
        self.height = height

    def require_inputs(self, *names: str) -> None:
        """It is what is asked for."""

    def run(self, image: np.ndarray) -> np.ndarray:
        self.seen = image
        return self.height[None, None].astype(np.float32)


@pytest.fixture
def bare_gel(sensor):
    """What a perfect network gives for an untouched gel: its dome above the apex plane, in grey levels."""
    return (sensor.gel_distance - sensor.gel_depth) / HEIGHT_UNIT


@pytest.fixture
def with_height(sensor, monkeypatch):
    """A depth network whose ONNX network gives a fixed height map."""

    def make(height: np.ndarray) -> tuple[FcrnDepthNet, FixedHeight]:
        fixed = FixedHeight(height)
        monkeypatch.setattr("midastouch_perception.tdn.depth_net.OnnxNetwork", lambda *_: fixed)
        return FcrnDepthNet("fixed.onnx", sensor), fixed

    return make


IMAGE = np.random.default_rng(0).integers(20, 180, (320, 240, 3), dtype=np.uint8)


@pytest.mark.slow
def test_names_shapes_and_output_are_the_official_ones(shared):
    reference = shared / "reference" / "fcrn"
    official = json.loads((reference / "state_dict_shapes.json").read_text())
    assert {name: tuple(shape) for name, shape in official.items()} == expected_shapes()
    with np.load(reference / "io.npz") as data:
        image, official = data["image"], data["output"]
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL  # takes longer than one run
    session = onnxruntime.InferenceSession(fcrn_model(formula_state()).SerializeToString(), options)
    ours = session.run(None, {"image": np.moveaxis(image, -1, 0)[None].astype(np.float32)})[0][0, 0]
    assert np.abs(ours - official).max() < 1e-4 * np.abs(official).max()


def test_an_up_projection_computes_its_definition():
    """Each of the four convolutions gives one pixel of every 2 x 2; both branches are added."""
    rng = np.random.default_rng(0)
    state = {"up.conv3.weight": rng.normal(size=(2, 2, 3, 3)), "up.conv3.bias": rng.normal(size=2)}
    for branch in (1, 2):
        for k, (size, _) in enumerate(QUARTERS, 1):
            state[f"up.conv{branch}_{k}.weight"] = rng.normal(size=(2, 4, *size))
            state[f"up.conv{branch}_{k}.bias"] = rng.normal(size=2)
    state |= {f"up.{n}.{part}": rng.uniform(0.5, 2, 2) for n in ("bn1_1", "bn1_2", "bn2") for part in NORM}

    def convolve(x, name, pads):
        top, left, bottom, right = pads
        kernel = state[f"{name}.weight"]
        padded = np.pad(x, ((0, 0), (top, bottom), (left, right)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape[2:], (1, 2))
        return np.einsum("chwij,ocij->ohw", windows, kernel) + state[f"{name}.bias"][:, None, None]

    def norm(x, name):
        w, b, mean, var = (state[f"{name}.{part}"][:, None, None] for part in NORM)
        return (x - mean) / np.sqrt(var + 1e-5) * w + b

    def interleaved(x, branch):
        out = np.empty((2, 2 * x.shape[1], 2 * x.shape[2]))
        for k, (_, pads) in enumerate(QUARTERS):
            out[:, k // 2 :: 2, k % 2 :: 2] = convolve(x, f"up.conv{branch}_{k + 1}", pads)
        return out

    x = rng.normal(size=(4, 5, 3))
    main = np.maximum(norm(interleaved(x, 1), "up.bn1_1"), 0)
    main = norm(convolve(main, "up.conv3", (1, 1, 1, 1)), "up.bn1_2")
    expected = np.maximum(main + norm(interleaved(x, 2), "up.bn2"), 0)

    graph = Graph({name: values.astype(np.float32) for name, values in state.items()})
    output = graph.up_projection("x", "up")
    model = graph.model("x", (4, 5, 3), output, (2, 10, 6))
    onnx.checker.check_model(model, full_check=True)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    got = session.run(None, {"x": x[None].astype(np.float32)})[0][0]
    np.testing.assert_allclose(got, expected, rtol=1e-4, atol=1e-4)


def test_the_image_is_stretched_over_all_channels_together(with_height, bare_gel):
    tdn, fixed = with_height(bare_gel)
    tdn.predict(IMAGE, IMAGE)
    assert fixed.seen.shape == (1, 3, 320, 240)
    assert (fixed.seen.min(), fixed.seen.max()) == (0, 255)
    low, high = int(IMAGE.min()), int(IMAGE.max())
    expected = (IMAGE[5, 7].astype(float) - low) * 255 / (high - low)
    np.testing.assert_allclose(fixed.seen[0, :, 5, 7], expected, atol=0.5 + 1e-6)
    for level in (0, 255):
        tdn.predict(np.full_like(IMAGE, level), IMAGE)
        assert np.isfinite(fixed.seen).all()
    with pytest.raises(InputError, match=r"tactile image: .* need"):
        tdn.predict(IMAGE[:100], IMAGE)


def test_bare_gel_is_no_penetration_and_a_press_has_its_depth(with_height, bare_gel):
    height = bare_gel.copy()
    height[100:140, 80:120] += 0.6e-3 / HEIGHT_UNIT
    height[200:240, 80:120] += 0.1e-3 / HEIGHT_UNIT  # below what the network can tell from none
    tdn, _ = with_height(height)
    penetration = tdn.predict(IMAGE, IMAGE)
    expected = np.zeros((160, 120))
    expected[50:70, 40:60] = 0.6e-3
    np.testing.assert_allclose(penetration, expected, atol=2e-6)
    assert penetration.dtype == np.float32
