"""Training of the `fast` tactile depth network on simulated touches (paper section 4.1, appendix A)."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import torch
from torch import nn

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.onnx_network import network_path
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.inputs import difference_input, geometry_input

from ..randomisation import RandomisationRange
from .export import export_onnx, unfold
from .run import TrainingRun, rendered_batches, rendering_process
from .setting import TrainingData, TrainingOptions
from .touches import shuffled, touches

_BATCH = 32
_RESERVOIR = 768
_CHECKS = 10  # batches to validate with
_SOFTENING = 0.03  # mm: below it the loss is quadratic
_LIGHT = 0.05  # mm added to a contact's depth, so that relative errors of light touches stay finite
_RELATIVE_WEIGHT, _CONTACT_WEIGHT = 0.2, 0.15  # of the loss's other terms; the RMSE has 1
CONTACT = 2e-5  # m: a pixel counts as touched from this penetration on


def _conv(inputs: int, outputs: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    convolution = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class UNet(nn.Module):
    """Network from difference image and sensor geometry to penetration and contact.

    forward(difference (B, 3, 160, 120), geometry (B, 3, 160, 120)) -> (B, 2, 160, 120): penetration [mm], contact
    logit. The inputs come from `inputs.difference_input` and `inputs.geometry_input`. The first layer halves the
    resolution, so the costly layers run at 80 x 60; sub-pixel convolution restores it.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 96, 128)):
        super().__init__()
        self.stem = nn.Sequential(_conv(6, widths[0], 2, 5), _conv(widths[0], widths[0]))
        pairs = list(itertools.pairwise(widths))
        self.down = nn.ModuleList(nn.Sequential(_conv(a, b, 2), _conv(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(nn.Sequential(_conv(a + b, a), _conv(a, a)) for a, b in reversed(pairs))
        self.head = nn.Sequential(nn.Conv2d(widths[0], 8, 3, 1, 1), nn.PixelShuffle(2))

    def forward(self, difference: torch.Tensor, geometry: torch.Tensor) -> torch.Tensor:
        return self.decode(self.encode(difference, geometry))

    def encode(self, difference: torch.Tensor, geometry: torch.Tensor) -> list[torch.Tensor]:
        """Return feature maps, fine to coarse; the last is the bottleneck (B, 128, 5, 4)."""
        features = [self.stem(torch.cat([difference, geometry], 1))]
        for layer in self.down:
            features.append(layer(features[-1]))
        return features

    def decode(self, features: list[torch.Tensor]) -> torch.Tensor:
        """Return the output of `forward` from the feature maps; empties the list."""
        out = features.pop()
        for layer in self.up:
            skip = features.pop()
            # factors that are plain numbers in the export let ONNX Runtime scale in the layout of its convolutions
            factors = tuple(float(skip.shape[k]) / float(out.shape[k]) for k in (-2, -1))
            out = nn.functional.interpolate(out, scale_factor=factors, mode="bilinear", align_corners=False)
            out = layer(torch.cat([out, skip], 1))
        return self.head(out)


class UNetWithEmbedding(nn.Module):
    """Trained `UNet` that also returns its bottleneck (B, 2560), L2-normalised: the paper's image embedding."""

    def __init__(self, unet: UNet):
        super().__init__()
        self.unet = unet

    def forward(self, difference: torch.Tensor, geometry: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        features = self.unet.encode(difference, geometry)
        embedding = nn.functional.normalize(features[-1].flatten(1), dim=1)
        return self.unet.decode(features), embedding


def training_sensors(light: str) -> list[SensorModel]:
    """Return the geometries to train for. For relative light: the real DIGIT's at several scales, and two flat gels.
    For additive light: mostly TACTO's, some real ones, and some in between."""
    tacto, real = SensorModel.load("digit_tacto").for_maps, SensorModel.load("digit_real").for_maps
    if light == "relative":
        flat = SensorModel.load("gelsight_mini").for_maps
        scaled = [dataclasses.replace(real, focal=f) for f in (170.0, 190.0, 215.0, 235.0)]
        return [real] * 3 + scaled + [flat, dataclasses.replace(flat, focal=1.3 * flat.focal)]
    real = dataclasses.replace(real, light=light)
    return [tacto] * 5 + [real] * 2 + [dataclasses.replace(real, focal=f) for f in (150.0, 185.0, 225.0)]


class _Batches(torch.utils.data.IterableDataset):
    """Batches (difference, geometry, penetration [mm]) of a worker's own seeded stream."""

    def __init__(
        self, meshes: list[ObjectMesh], backgrounds: np.ndarray, ranges: RandomisationRange, light: str, seed: int
    ):
        self.meshes, self.backgrounds, self.ranges = meshes, backgrounds, ranges
        self.light, self.seed = light, seed

    def __iter__(self):
        rng = np.random.default_rng([self.seed, rendering_process()])
        sensors = training_sensors(self.light)
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
    """Return the loss: the RMSE of each map's penetration [mm], plus, weighted, the RMSE within the contact relative to
    the contact's depth, and the cross-entropy of the contact mask.

    The root is taken per map: with a mean of squares, the blurriest sensors would dominate the gradient. Without the
    relative term, a light touch would hardly count.
    """
    contact = (penetration > CONTACT * 1e3).float()
    off, touched = (output[:, 0] - penetration) ** 2, contact.sum(dim=(1, 2)).clamp(min=1)
    rmse = (off.mean(dim=(1, 2)) + _SOFTENING**2).sqrt()
    inside = ((off * contact).sum(dim=(1, 2)) / touched + 1e-6).sqrt()
    depth = ((penetration**2 * contact).sum(dim=(1, 2)) / touched).sqrt()
    relative = inside / (depth + _LIGHT)
    in_contact = nn.functional.binary_cross_entropy_with_logits(output[:, 1], contact)
    return rmse.mean() + _RELATIVE_WEIGHT * relative.mean() + _CONTACT_WEIGHT * in_contact


@torch.no_grad()
def validate(model: nn.Module, batches: list) -> dict[str, float]:
    """Return the RMSE [mm] over all pixels and the contact IoU on fixed batches of unseen objects and backgrounds."""
    squared, pixels, both, either = 0.0, 0, 0, 0
    for difference, geometry, penetration in batches:
        out = model(difference, geometry)
        mask, truth = out[:, 1] > 0, penetration > CONTACT * 1e3
        predicted = out[:, 0].clamp(min=0) * mask
        squared += float(((predicted - penetration) ** 2).sum())
        pixels += penetration.numel()
        both += int((mask & truth).sum())
        either += int((mask | truth).sum())
    return {"rmse_mm": (squared / pixels) ** 0.5, "contact_iou": both / max(either, 1)}


def train(options: TrainingOptions) -> Path:
    """Train; write the network, its card, log and checkpoints into the options' folder; return the network's path.

    The file is `tdn_fast.onnx`, or `tdn_fast_relative.onnx` for relative light.
    """
    torch.manual_seed(options.seed)
    data = TrainingData.load(options)
    model = UNet().to(options.device, memory_format=torch.channels_last)
    if options.start and not options.resume:
        batch = next(iter(_Batches(data.meshes, data.backgrounds, data.ranges, options.light, options.seed)))
        unfold(model, network_path("tdn", options.start), *batch[:2])
    run = TrainingRun(model, options, 3e-4 if options.start or options.resume else 3e-3)
    print(f"making touches of {len(data.held_out)} objects, to validate with", flush=True)
    validation = _Batches(data.held_out, data.held_out_backgrounds, data.ranges, options.light, options.seed + 1000)
    checks = [tuple(part.to(options.device) for part in one) for one in itertools.islice(validation, _CHECKS)]
    seed = options.seed + 7919 * run.step
    stream = _Batches(data.meshes, data.backgrounds, data.ranges, options.light, seed)
    batches = rendered_batches(stream, options, ahead=8)

    def loss_of(batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
        difference, geometry, penetration = batch
        difference = difference.to(options.device).to(memory_format=torch.channels_last)
        with run.autocast:
            output = model(difference, geometry.to(options.device))
        return loss_function(output.float(), penetration.to(options.device))

    run.fit(batches, loss_of, lambda: validate(run.averaged(UNet), checks), every=250)
    card = {
        "network": options.network("tdn"),
        "light": options.light,
        "data": {
            "meshes": len(data.meshes),
            "touches": run.step * _BATCH,
            "backgrounds": len(data.backgrounds),
            "real_colour_table": options.colour_table is not None,
        },
        **run.card("tdn"),
    }
    return export(run.averaged(UNet), card, options.out / f"{options.network('tdn')}.onnx")


def export(model: UNet, card: dict, path: Path) -> Path:
    """Write the network with both its outputs and its card; return `path`."""
    example = {"difference": torch.zeros(1, 3, 160, 120), "geometry": torch.zeros(1, 3, 160, 120)}
    return export_onnx(UNetWithEmbedding(model).eval(), example, ["penetration_contact", "embedding"], card, path)
