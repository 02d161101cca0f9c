"""Both networks' training, a few steps long. Needs PyTorch (the `train` extra)."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.files import sha256
from midastouch_common.mesh import ObjectMesh
from midastouch_simulation.training import setting
from midastouch_simulation.training.setting import TrainingData, TrainingOptions, stretched


@pytest.fixture
def options(tmp_path, monkeypatch):
    monkeypatch.setattr(setting, "PROCEDURAL_OBJECTS", 0)
    meshes, backgrounds = tmp_path / "meshes", tmp_path / "backgrounds"
    meshes.mkdir()
    backgrounds.mkdir()
    trimesh.creation.box([0.06, 0.04, 0.03]).subdivide().export(meshes / "003_box.ply")
    trimesh.creation.capsule(0.05, 0.015).export(meshes / "019_capsule.ply")
    trimesh.creation.box([0.05, 0.05, 0.05]).export(meshes / "035_never_trained_on.ply")
    rng = np.random.default_rng(0)
    for i in range(8):
        cv2.imwrite(str(backgrounds / f"{i}.png"), rng.integers(80, 160, (32, 24, 3)).astype(np.uint8))
    return TrainingOptions(meshes, backgrounds, None, tmp_path / "out", steps=2, workers=0)


def test_what_is_trained_on_and_what_is_not(options, tmp_path):
    data = TrainingData.load(options)
    assert [m.name for m in data.meshes] == ["003_box"]
    assert [m.name for m in data.held_out] == ["019_capsule"]
    assert len(data.backgrounds) == len(data.held_out_backgrounds) == 4
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"\.ply"):
        TrainingData.load(replace(options, meshes=tmp_path / "empty"))
    with pytest.raises(InputError, match="at least 8"):
        TrainingData.load(replace(options, backgrounds=tmp_path / "empty"))


def test_a_stretched_object_has_other_proportions():
    sphere = trimesh.creation.icosphere(3, 0.02)
    ball = ObjectMesh.from_arrays(sphere.vertices, sphere.faces, "ball")
    extents = [np.ptp(stretched(ball, np.random.default_rng(s)).vertices, axis=0) for s in range(20)]
    assert 0.7 * 0.04 - 1e-9 <= np.min(extents) < 0.8 * 0.04
    assert 1.25 * 0.04 < np.max(extents) <= 1.4 * 0.04 + 1e-9
    assert max(e.max() / e.min() for e in extents) > 1.2


@pytest.mark.parametrize("native", [True, False])
def test_only_a_cpu_that_has_bfloat16_computes_in_it(native, options, monkeypatch):
    torch = pytest.importorskip("torch", reason="training needs PyTorch: pip install -r tools/requirements/train.txt")
    from midastouch_simulation.training.run import TrainingRun

    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx2": True, "avx512_bf16": native})
    layer = torch.nn.Linear(2, 2)
    with TrainingRun(layer, options, 1e-3).autocast:
        assert layer(torch.zeros(1, 2)).dtype == (torch.bfloat16 if native else torch.float32)


@pytest.mark.parametrize("network", ["tdn", "tcn"])
def test_a_run_of_so_many_steps_is_repeatable_and_can_be_resumed(network, options, tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch", reason="training needs PyTorch: pip install -r tools/requirements/train.txt")
    if network == "tdn":
        from midastouch_perception.tdn.inference import load_tdn as load
        from midastouch_simulation.training import tdn as module

        sizes = {"_BATCH": 4, "_RESERVOIR": 8, "_CHECKS": 1}
    else:
        from midastouch_perception.tcn.inference import load_tcn as load
        from midastouch_simulation.training import tcn as module

        sizes = {"_GROUP": 30, "_QUERIES": 20, "_BOOK": 64, "_SENSORS": 2}
    for name, value in sizes.items():
        monkeypatch.setattr(module, name, value)
    train = module.train
    first = train(options)
    assert "of 1 objects, to validate with" in capsys.readouterr().out
    again = train(replace(options, out=tmp_path / "again"))
    assert sha256(first.parent / "checkpoint.safetensors") == sha256(again.parent / "checkpoint.safetensors")
    assert load(first).network_id.startswith(f"{network}_fast")
    # this one with a rendering process of its own, as in real runs
    resumed = train(replace(options, out=tmp_path / "resumed", resume=first.parent, workers=1))
    card = json.loads(resumed.with_suffix(".json").read_text())
    command = f"midastouch train-{network} --steps 2 --seed 0"
    assert card["commands"] == [command, f"{command} --resume DIR"]
    log = (resumed.parent / "log.csv").read_text().splitlines()
    assert [line.split(",")[1] for line in log] == ["step", "2", "4"]
    with pytest.raises(InputError, match="cannot resume"):
        train(replace(options, resume=tmp_path / "nowhere"))
