"""Training of the `fast` tactile depth network on simulated touches (paper section 4.1, appendix A)."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import torch
from torch import nn

from ..sensor_model import SensorModel
from ..simulation.colour_table import ColourTable
from ..simulation.randomisation import RandomisationRange
from ..training.backgrounds import load_backgrounds
from ..training.export import export_onnx
from ..training.objects import load_objects
from ..training.run import TrainingRun, plot_log
from ..training.touches import shuffled, touches
from .inputs import SCALE, difference_input, geometry_input
from .network import UNet

_BATCH = 32
_RESERVOIR = 768
_SOFTENING = 0.03  # mm: below it the loss is quadratic
CONTACT = 2e-5  # m: a pixel counts as touched from this penetration on


def training_sensors() -> list[SensorModel]:
    """The geometries trained for: mostly TACTO's, the real DIGIT's, and some in between."""
    tacto, real = SensorModel.load("digit_tacto").scaled(SCALE), SensorModel.load("digit_real").scaled(SCALE)
    between = [dataclasses.replace(real, focal=f) for f in (150.0, 185.0, 225.0)]
    return [tacto] * 5 + [real] * 2 + between


class _Batches(torch.utils.data.IterableDataset):
    """Batches (difference, geometry, penetration mm) of a worker's own seeded stream."""

    def __init__(self, meshes: list, backgrounds: np.ndarray, ranges: RandomisationRange, seed: int):
        self.meshes, self.backgrounds, self.ranges, self.seed = meshes, backgrounds, ranges, seed

    def __iter__(self):
        import cv2
        import numba

        numba.set_num_threads(1)
        cv2.setNumThreads(1)
        worker = torch.utils.data.get_worker_info()
        rng = np.random.default_rng([self.seed, worker.id if worker else 0])
        sensors = training_sensors()
        geometry = {sensor: geometry_input(sensor) for sensor in sensors}
        stream = shuffled(touches(self.meshes, sensors, self.backgrounds, rng, self.ranges), _RESERVOIR, rng)
        while True:
            batch = list(itertools.islice(stream, _BATCH))
            yield (
                torch.from_numpy(difference_input(np.stack([t.difference for t in batch]))),
                torch.from_numpy(np.stack([geometry[t.sensor] for t in batch])),
                torch.from_numpy(np.stack([t.penetration for t in batch]) * 1e3),
            )


def loss_function(output: torch.Tensor, penetration: torch.Tensor) -> torch.Tensor:
    """RMSE of each map's penetration [mm] and cross-entropy of the contact mask.

    Root per map, not mean of squares: the blurriest of sensors would take nearly all of the gradient.
    """
    contact = (penetration > CONTACT * 1e3).float()
    squared = ((output[:, 0] - penetration) ** 2).mean(dim=(1, 2))
    return (squared + _SOFTENING**2).sqrt().mean() + 0.15 * nn.functional.binary_cross_entropy_with_logits(
        output[:, 1], contact
    )


@torch.no_grad()
def validate(model: nn.Module, batches: list) -> dict[str, float]:
    """RMSE [mm] over all pixels and contact IoU on fixed batches of unseen objects and backgrounds."""
    squared, pixels, both, either = 0.0, 0, 0, 0
    for difference, geometry, penetration in batches:
        out = model(difference, geometry)
        mask, truth = out[:, 1] > 0, penetration > CONTACT * 1e3
        predicted = torch.where(mask, out[:, 0].clamp(min=0), torch.zeros(()))
        squared += float(((predicted - penetration) ** 2).sum())
        pixels += penetration.numel()
        both += int((mask & truth).sum())
        either += int((mask | truth).sum())
    return {"rmse_mm": (squared / pixels) ** 0.5, "contact_iou": both / max(either, 1)}


def train(
    meshes: Path,
    backgrounds: Path,
    colour_table: Path | None,
    out: Path,
    minutes: float = 30,
    seed: int = 0,
    workers: int = 1,
    device: str = "cpu",
    resume: Path | None = None,
) -> Path:
    """Train for `minutes` and write `tdn_fast.onnx` and `tdn_fast.json` into `out`; returns the ONNX path.

    meshes: folder of YCB scans; backgrounds: folder of no-contact images; colour_table: Taxim's
    table of a real DIGIT. Logs and checkpoints go to `out` too.
    """
    torch.manual_seed(seed)
    train_meshes, held_out = load_objects(meshes, procedural=24, seed=seed)
    sensor = SensorModel.load("digit_tacto").scaled(SCALE)
    train_backgrounds, other_backgrounds = load_backgrounds(backgrounds, sensor.height, sensor.width)
    ranges = RandomisationRange(colour_table=colour_table and ColourTable.load(colour_table))
    model = UNet().to(device, memory_format=torch.channels_last)
    run = TrainingRun(model, minutes, 3e-3, Path(out), resume)
    checks = list(itertools.islice(iter(_Batches(held_out, other_backgrounds, ranges, seed + 1000)), 10))
    loader = torch.utils.data.DataLoader(
        _Batches(train_meshes, train_backgrounds, ranges, seed + 7919 * run.step),
        batch_size=None,
        num_workers=workers,
        prefetch_factor=8,
        multiprocessing_context="spawn",  # forking after Numba has started its threads aborts
    )
    recent: list[float] = []
    model.train()
    for difference, geometry, penetration in loader:
        difference = difference.to(device).to(memory_format=torch.channels_last)
        with torch.autocast(device, torch.bfloat16):
            output = model(difference, geometry.to(device))
        loss = loss_function(output.float(), penetration.to(device))
        run.update(loss)
        recent.append(float(loss.detach()))
        if run.step % 250 == 0 or run.progress >= 1:
            figures = validate(run.averaged(UNet), checks)
            run.record(loss=float(np.mean(recent)), **figures)
            recent.clear()
        if run.progress >= 1:
            break
    plot_log(run.rows, Path(out) / "log.png")
    card = {
        "network": "tdn_fast",
        "data": {"meshes": len(train_meshes), "touches": run.step * _BATCH, "backgrounds": len(train_backgrounds)},
        "minutes": round(run.minutes, 1),
        "seed": seed,
        "command": f"midastouch train-tdn --minutes {minutes:g} --seed {seed}",
        "validation": {k: round(v, 4) for k, v in run.rows[-1].items()},
        "licence": "MIT",
    }
    example = {"difference": torch.zeros(1, 3, 160, 120), "geometry": torch.zeros(1, 3, 160, 120)}
    return export_onnx(run.averaged(UNet), example, "penetration_contact", card, Path(out) / "tdn_fast.onnx")
