import shutil
from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_perception.onnx_network import WEIGHTS, OnnxNetwork, read_card, write_card
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn import load_tdn


@pytest.mark.parametrize("kind", ["tdn", "tcn"])
def test_shipped_networks_have_cards_and_stay_small(kind):
    network = OnnxNetwork(kind, "fast")
    assert network.network_id.startswith(f"{kind}_fast-")
    assert {"data", "minutes", "seed", "validation", "licence"} <= set(network.card)
    assert (WEIGHTS / f"{kind}_fast.onnx").stat().st_size < 16e6


@pytest.mark.parametrize("name", ["tdn_fast", "tdn_fast_relative"])
def test_shipped_networks_scale_by_factors(name):
    onnx = pytest.importorskip("onnx")
    nodes = onnx.load(WEIGHTS / f"{name}.onnx").graph.node
    scaled = [len(node.input) for node in nodes if node.op_type == "Resize"]
    assert scaled == [3] * 4, "scaling to a size leaves the layout of ONNX Runtime's convolutions: a tenth slower"


def test_unusable_networks_are_named(tmp_path):
    with pytest.raises(InputError, match=r"slow.*use fast"):
        OnnxNetwork("tdn", "slow")
    for name, length, said in (("cut", 5000, r"cut.onnx: "), ("mine", None, r"mine.json: ")):
        (tmp_path / f"{name}.onnx").write_bytes((WEIGHTS / "tdn_fast.onnx").read_bytes()[:length])
        with pytest.raises(InputError, match=said):
            OnnxNetwork("tdn", tmp_path / f"{name}.onnx")


def test_identity_follows_the_content(tmp_path):
    path = tmp_path / "tdn_fast.onnx"
    path.write_bytes((WEIGHTS / "tdn_fast.onnx").read_bytes() + b"\0")
    shutil.copy(WEIGHTS / "tdn_fast.json", tmp_path / "tdn_fast.json")
    try:
        other = OnnxNetwork("tdn", path).network_id
    except InputError:
        return  # a strict parser refuses the extra byte, which is as good
    assert other != OnnxNetwork("tdn", "fast").network_id


def test_a_network_that_is_not_that_of_its_card_is_refused(tmp_path):
    """Otherwise one damaged weight would make every code another one, or none at all."""
    path = tmp_path / "tcn_fast.onnx"
    content = bytearray((WEIGHTS / path.name).read_bytes())
    content[len(content) // 2] ^= 64
    path.write_bytes(content)
    card = read_card(WEIGHTS / path.name)
    del card["sha256"]
    write_card(card, path)
    load_tcn(path)
    shutil.copy(WEIGHTS / "tcn_fast.json", tmp_path)
    damaged = r"tcn_fast\.onnx: damaged, or not the network of its model card tcn_fast\.json"
    with pytest.raises(InputError, match=damaged):
        load_tcn(path)


@pytest.mark.parametrize(
    "change",
    [
        {"dim": None},
        {"dim": 10**9},
        {"calibration": {"temperature": 0.1}},
        {"calibration": {"temperature": float("inf"), "outlier": 0.1}},
        {"calibration": {"temperature": 0.1, "outlier": 1}},
        {"calibration": []},
    ],
)
def test_cards_of_code_networks_are_checked(tmp_path, change):
    path = Path(shutil.copy(WEIGHTS / "tcn_fast.onnx", tmp_path))
    write_card(read_card(WEIGHTS / path.name) | change, path)
    with pytest.raises(InputError, match=r"tcn_fast\.json: not the model card of a code network"):
        load_tcn(path)


@pytest.mark.parametrize(("load", "other"), [(load_tdn, "tcn_fast"), (load_tcn, "tdn_fast")])
def test_networks_that_are_mixed_up_are_refused(load, other):
    with pytest.raises(InputError, match=rf"{other}\.onnx: .*mixed up"):
        load(WEIGHTS / f"{other}.onnx")
