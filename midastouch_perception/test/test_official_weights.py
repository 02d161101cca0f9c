import json
import sys

import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_common.files import sha256
from midastouch_perception import official_weights
from midastouch_perception.official_weights import import_weights, read_checkpoint
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn import fcrn_graph, load_tdn
from midastouch_perception.tdn.fcrn import FcrnDepthNet

STATE = {
    "weight": np.arange(6, dtype=np.float32).reshape(2, 3),
    "half": np.array([1.5, -2], np.float16),
    "count": np.array(7, np.int64),
}


@pytest.fixture
def torch():
    return pytest.importorskip("torch", reason="PyTorch is in the train extra")


def equal(got: dict, expected: dict) -> bool:
    return got.keys() == expected.keys() and all(np.array_equal(got[k], v) for k, v in expected.items())


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
    image, tdn = np.full((320, 240, 3), 200, np.uint8), load_tdn(path)
    assert isinstance(tdn, FcrnDepthNet)
    assert tdn.network_id.startswith("tdn_fcrn-")
    assert tdn.predict(image, image).shape == (160, 120)


def test_missing_and_misshapen_tensors_are_listed(minkloc_state, tmp_path):
    state = dict(minkloc_state)
    del state["pooling.p"]
    state["backbone.conv0.kernel"] = state["backbone.conv0.kernel"][:27]
    np.savez(tmp_path / "small.npz", **state)
    with pytest.raises(InputError) as caught:
        import_weights(tmp_path / "small.npz", tmp_path / "out")
    for named in ("small.npz", "tcn_minkloc3d", "pooling.p", "backbone.conv0.kernel", "(27, 1, 32)", "(125, 1, 32)"):
        assert named in str(caught.value)
    assert not (tmp_path / "out").exists()
    np.savez(tmp_path / "other.npz", fc=np.ones(3))
    with pytest.raises(InputError, match=r"other.npz: .*FCRN.*MinkLoc3D.*fc"):
        import_weights(tmp_path / "other.npz", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_archive_is_read_and_what_is_none_refused(tmp_path):
    np.savez(tmp_path / "net.npz", **STATE)
    assert equal(read_checkpoint(tmp_path / "net.npz"), STATE)
    whole = (tmp_path / "net.npz").read_bytes()
    for length in (10, 200, -1):
        (tmp_path / "cut.npz").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut.npz: .*get it again"):
            read_checkpoint(tmp_path / "cut.npz")
    np.savez(tmp_path / "objects.npz", weight=np.array([{}], object))
    (tmp_path / "page.pth.tar").write_text("<!DOCTYPE html><html><head><title>Virus scan warning</title>")
    for name, said in (
        ("objects.npz", r"objects.npz: "),
        ("page.pth.tar", "page.pth.tar: .*<!DOCTYPE.*download it again"),
        ("missing.pth", "no such weight file"),
        (".", "is a folder; give the weight file"),
    ):
        with pytest.raises(InputError, match=said):
            read_checkpoint(tmp_path / name)


@pytest.mark.parametrize(
    ("package", "content"), [("torch", b"\x80\x02}."), ("safetensors", (2).to_bytes(8, "little") + b"{}")]
)
def test_a_missing_package_is_named_with_the_extra(tmp_path, monkeypatch, package, content):
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, f"{package}.numpy", raising=False)
    (tmp_path / "net.pth").write_bytes(content)
    with pytest.raises(InputError, match=rf"net.pth: .*{package}.*tools/requirements/train.txt"):
        read_checkpoint(tmp_path / "net.pth")


def test_safetensors(tmp_path):
    safetensors = pytest.importorskip("safetensors.numpy", reason="safetensors is in the train extra")
    safetensors.save_file(STATE, tmp_path / "net.safetensors")
    assert equal(read_checkpoint(tmp_path / "net.safetensors"), STATE)
    whole = (tmp_path / "net.safetensors").read_bytes()
    for length in (0, 9, 40, len(whole) - 1):
        (tmp_path / "cut.safetensors").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut.safetensors: "):
            read_checkpoint(tmp_path / "cut.safetensors")


@pytest.mark.parametrize("state_key", [None, "state_dict", "model_state_dict", "model"])
@pytest.mark.parametrize("archive", [True, False])
def test_a_checkpoint_of_torch(torch, tmp_path, state_key, archive):
    """The whole file or one of the usual entries; views, types that NumPy lacks, the format before PyTorch 1.6."""
    base = torch.arange(30.0).reshape(5, 6)
    state = {"transposed": base.t(), "window": base[1:3, 2:4], "brain": base.bfloat16(), "whole": torch.arange(4)}
    state |= {"parameter": torch.nn.Parameter(base), "scalar": torch.tensor(2.5)}
    path = tmp_path / "net.pth.tar"
    content = {"epoch": 1, state_key: state, "optimizer": {"lr": 0.1}} if state_key else state
    torch.save(content, path, _use_new_zipfile_serialization=archive)
    got = read_checkpoint(path)
    assert list(got) == list(state)
    for name, values in state.items():
        np.testing.assert_array_equal(got[name], values.detach().to(torch.float64).numpy())


class _Foreign:
    """A class of somebody's training script."""


@pytest.mark.parametrize("content", [[1, 2], {"epoch": 3}, {}, {"model": _Foreign()}, None])
def test_a_file_of_torch_without_tensors_alone_is_refused(torch, tmp_path, content):
    torch.save({"x": torch.arange(12.0)} if content is None else content, tmp_path / "net.pth")
    whole = (tmp_path / "net.pth").read_bytes()
    for length in range(2, len(whole), 97) if content is None else [None]:  # cut
        (tmp_path / "net.pth").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"net.pth: "):
            read_checkpoint(tmp_path / "net.pth")
