import json

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.files import sha256
from midastouch_perception import official_weights
from midastouch_perception.official_weights import import_weights
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn import fcrn_graph, load_tdn


@pytest.fixture
def checkpoint(minkloc_state, tmp_path):
    """A code network as training leaves it: wrapped names, batch counters."""
    counters = {"module.backbone.bn0.bn.num_batches_tracked": np.array(5)}
    path = tmp_path / "tcn_weights.npz"
    np.savez(path, **{f"module.{name}": values for name, values in minkloc_state.items()}, **counters)
    return path


def test_a_code_network_becomes_loadable(checkpoint, tmp_path):
    path = import_weights(checkpoint, tmp_path / "out", voxel_size=0.01)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["tcn_minkloc3d.json", "tcn_minkloc3d.npz"]
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["source"] == {"file": "tcn_weights.npz", "sha256": sha256(checkpoint)}
    assert (card["architecture"], card["dim"], card["voxel_size"]) == ("minkloc3d", 256, 0.01)
    assert card["parameters"] == 1_055_713
    assert load_tcn(path).encode(np.full((160, 120), 1e-3, np.float32)).shape == (256,)


def test_a_depth_network_becomes_loadable(tmp_path, monkeypatch):
    """Without its 64 million weights: the graph is tested in tdn/test_fcrn.py, here only the way to it."""
    monkeypatch.setitem(official_weights.EXPECTED_SHAPES, "tdn_fcrn", lambda: {"conv.weight": (1, 3, 1, 1)})

    def one_layer(state):
        graph = fcrn_graph.Graph(state)
        return graph.model("image", (3, 320, 240), graph.convolution("image", "conv", ""), (1, 320, 240))

    monkeypatch.setattr(fcrn_graph, "fcrn_model", one_layer)
    np.savez(tmp_path / "tdn_weights.npz", **{"conv.weight": np.full((1, 3, 1, 1), 0.5)})
    path = import_weights(tmp_path / "tdn_weights.npz", tmp_path / "out")
    assert path == tmp_path / "out" / "tdn_fcrn.onnx"
    image = np.full((320, 240, 3), 200, np.uint8)
    assert load_tdn(path).predict(image, image).shape == (160, 120)


def test_missing_and_misshapen_tensors_are_listed(minkloc_state, tmp_path):
    state = dict(minkloc_state)
    del state["pooling.p"]
    state["backbone.conv0.kernel"] = state["backbone.conv0.kernel"][:27]
    np.savez(tmp_path / "small.npz", **state)
    with pytest.raises(InputError) as caught:
        import_weights(tmp_path / "small.npz", tmp_path / "out")
    assert str(caught.value).endswith(
        "small.npz: not the official tcn_minkloc3d: missing: pooling.p; "
        "of wrong shape: backbone.conv0.kernel (27, 1, 32) instead of (125, 1, 32)"
    )
    assert not (tmp_path / "out").exists()


def test_weights_of_other_networks_are_told(tmp_path):
    np.savez(tmp_path / "other.npz", fc=np.ones(3))
    with pytest.raises(
        InputError, match=r"holds neither the depth network \(FCRN\) nor the code network .*: fc \.\.\."
    ):
        import_weights(tmp_path / "other.npz", tmp_path / "out")
    assert not (tmp_path / "out").exists()
