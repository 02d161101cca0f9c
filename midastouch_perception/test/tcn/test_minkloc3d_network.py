"""Against the official network's activations where they are at hand, and against the definition, unfolded, always."""

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.tcn.minkloc3d_network import MinkLoc3D, Voxels, expected_shapes, quantise


@pytest.fixture(scope="module")
def reference(shared):
    return shared / "reference" / "minkloc3d"


@pytest.fixture(scope="module")
def official(reference):
    with np.load(reference / "tcn_random_state.npz") as data:
        return MinkLoc3D(dict(data))


def test_names_and_shapes_are_the_official_ones(reference):
    with np.load(reference / "tcn_random_state.npz") as data:
        shapes = {name: data[name].shape for name in data.files if not name.endswith("num_batches_tracked")}
    assert shapes == expected_shapes()


@pytest.mark.parametrize("voxel_size", [pytest.param(0.001, marks=pytest.mark.slow), 0.01])
def test_codes_of_touches_equal_the_official_ones(reference, official, voxel_size):
    with np.load(reference / f"tactile24_q{voxel_size}.npz") as data:
        clouds, coords, out = data["clouds_n"], data["coords"], data["out"]
    for i, cloud in enumerate(clouds):
        voxels = quantise(cloud, voxel_size)
        np.testing.assert_array_equal(voxels.coordinates, Voxels(coords[coords[:, 0] == i, 1:]).coordinates)
        np.testing.assert_allclose(official(voxels), out[i], atol=1e-5)


@pytest.mark.parametrize("case", ["rand_dense", "rand_sparse", "one", "one_neg", "two", "line"])
def test_edge_cases_equal_the_official_ones(reference, official, case):
    with np.load(reference / "edge_cases.npz") as data:
        np.testing.assert_allclose(official(Voxels(data[f"{case}_C"][:, 1:])), data[f"{case}_out"][0], atol=1e-5)


def by_definition(state: dict[str, np.ndarray], coordinates: np.ndarray) -> np.ndarray:
    """Code of voxels, layer by layer, voxel by voxel, nothing folded."""
    offsets = {
        len(span) ** 3: [np.array((x, y, z)) for z in span for y in span for x in span]
        for span in (range(2), range(-1, 2), range(-2, 3))
    }

    def norm(x, name):
        w, b, mean, var = (state[f"backbone.{name}.bn.{k}"] for k in ("weight", "bias", "running_mean", "running_var"))
        return {c: (v - mean) / np.sqrt(var + 1e-5) * w + b for c, v in x.items()}

    def relu(x):
        return {c: np.maximum(v, 0) for c, v in x.items()}

    def convolve(x, name, targets=None, stride=1):
        kernel = state[f"backbone.{name}.kernel"].astype(float)
        out = {}
        for c in targets or x:
            reached = ((tuple(stride * np.array(c) + o), w) for o, w in zip(offsets[len(kernel)], kernel, strict=True))
            out[c] = sum(x[n] @ w for n, w in reached if n in x)
        return out

    x = {tuple(map(int, c)): np.ones(1) for c in coordinates}
    x = relu(norm(convolve(x, "conv0"), "bn0"))
    levels = []
    for i in range(3):
        held = {tuple(v // 2 for v in c) for c in x}
        x = relu(norm(convolve(x, f"convs.{i}", held, stride=2), f"bn.{i}"))
        block = f"blocks.{i}.0"
        y = relu(norm(convolve(x, f"{block}.conv1"), f"{block}.norm1"))
        y = norm(convolve(y, f"{block}.conv2"), f"{block}.norm2")
        if i == 1:
            kernel = state[f"backbone.{block}.downsample.0.kernel"]
            x = norm({c: v @ kernel for c, v in x.items()}, f"{block}.downsample.1")
        x = relu({c: x[c] + y[c] for c in x})
        levels.append(x)
    top = {c: v @ state["backbone.conv1x1.0.kernel"] for c, v in levels[2].items()}
    rows = []
    for c, v in levels[1].items():
        holder = tuple(k // 2 for k in c)
        part = sum((k % 2) << axis for axis, k in enumerate(c))
        rows.append(v @ state["backbone.conv1x1.1.kernel"] + top[holder] @ state["backbone.tconvs.0.kernel"][part])
    p = float(state["pooling.p"][0])
    return (np.maximum(rows, 1e-6) ** p).mean(axis=0) ** (1 / p)


@pytest.mark.parametrize("spread", [3, 30])
def test_network_computes_its_definition(minkloc_state, spread):
    points = np.random.default_rng(spread).integers(-spread, spread, size=(60, 3))
    code = MinkLoc3D(minkloc_state)(Voxels(points))
    np.testing.assert_allclose(code, by_definition(minkloc_state, points), rtol=1e-4, atol=1e-5)
    assert code.std() > 0.01


def test_quantise_rounds_down_to_a_grid_within_64_bits():
    cloud = np.array([[0.0, 0.0299, -0.0001], [0.01, -0.03, 1.0]], np.float32)
    assert sorted(map(tuple, quantise(cloud, 0.01).coordinates)) == [(0, 2, -1), (1, -3, 100)]
    with pytest.raises(InputError, match="too fine; use a larger voxel size"):
        quantise(np.array([[0, 0, 0], [1, 1, 1]], np.float32), 1e-9)
