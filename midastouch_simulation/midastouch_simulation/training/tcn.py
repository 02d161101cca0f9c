"""Training and calibration of the `fast` tactile code network.

The loss is contrastive (InfoNCE, van den Oord et al. 2018) between touches and codebook entries of one object: a touch
that went through randomised optics and the depth network must pick, among many entries of its object, the one of its
pose. At the optimum the score divided by the temperature is log p(touch | entry) - log p(touch), which is exactly the
log-likelihood ratio the filter needs (paper section 4.2 uses a triplet loss, which gives no such scale).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize
from torch import nn

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import geodesic_distances
from midastouch_perception.codebook import PRESS, codebook_poses
from midastouch_perception.contact import ContactDetector
from midastouch_perception.onnx_network import network_path
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import MAX_PENETRATION, SensorModel
from midastouch_perception.tcn.inference import code_input
from midastouch_perception.tcn.network import CodeNet
from midastouch_perception.tdn.inference import TactileDepthNet

from ..randomisation import RandomisationRange, RandomSensor
from .export import export_onnx, unfold
from .run import TrainingRun, rendered_batches, rendering_process
from .setting import TrainingData, TrainingOptions, stretched
from .touches import misread

_GROUP = 256  # touches of one object that are contrasted with each other
_REUSE = 12  # mean number of times that a group of touches is shown, with new entries, mirroring and misreadings
_POOL = 24, 160  # fewest and most groups that wait to be shown again
_EVERY = 400  # steps between validations
_QUERIES, _BOOK = 160, 3072  # touches and entries of each object to validate with
_SENSORS = 16  # imaginary DIGITs per group
_SAMPLING = ContactSampling(press=(0.3e-3, 2e-3), free_fraction=0.0)
_CELL = (2.5e-3, 2.5e-3, 0.3e-3, np.radians(6), np.radians(6), np.radians(12))  # half cell of a codebook entry
_MIN_PIXELS = 40  # of contact; fewer contain no information


@dataclasses.dataclass
class _TouchGroup:
    """Touches of one object.

    Attributes: poses (N, 4, 4), true gel poses; maps (N, H, W) m, the contacts that were measured, in half precision
    because many groups wait; renderer of the object.
    """

    poses: np.ndarray
    maps: np.ndarray
    renderer: PenetrationRenderer


class _Touches:
    """Source of groups of touches, through random optics and the depth network, and of their codebook entries."""

    def __init__(self, backgrounds: np.ndarray, ranges: RandomisationRange, tdn: TactileDepthNet, seed: int):
        self.backgrounds, self.ranges, self.tdn = backgrounds, ranges, tdn
        self.sensor = tdn.sensor
        self.rng = np.random.default_rng(seed)

    def group(self, mesh: ObjectMesh, size: int) -> _TouchGroup:
        rng, renderer = self.rng, PenetrationRenderer(mesh, self.sensor)
        poses = self._clustered(renderer, sample_contact_poses(mesh, size, rng, self.sensor, _SAMPLING))
        penetration, normals = renderer.render_with_normals(poses)
        maps = np.empty_like(penetration)
        for part in np.array_split(rng.permutation(size), _SENSORS):
            imaginary = RandomSensor(self.sensor, self.backgrounds, rng, self.ranges)
            images, reference = imaginary.images(penetration[part], normals[part], rng)
            measured = self.tdn.penetration(images - reference)
            maps[part] = [ContactDetector(self.sensor).update(one).penetration for one in measured]
        kept = ((maps > 0).sum(axis=(1, 2)) >= _MIN_PIXELS) & ((penetration > 0).sum(axis=(1, 2)) >= _MIN_PIXELS)
        return _TouchGroup(poses[kept], maps[kept].astype(np.float16), renderer)

    def _clustered(self, renderer: PenetrationRenderer, poses: np.ndarray) -> np.ndarray:
        """Return the poses with half of them moved next to others: the hard negatives that a tracking filter meets.

        Half of these are turned by any angle about the normal: the same point upside down is the most frequent mistake.
        """
        rng, count = self.rng, len(poses) // 2
        near = poses[rng.choice(len(poses), count)]
        shift = rng.standard_normal((count, 6)) * [5e-3, 5e-3, 0, 0, 0, 0]
        turn = np.zeros((count, 6))
        turn[:, 5] = np.where(
            rng.random(count) < 0.5, np.radians(30) * rng.standard_normal(count), rng.uniform(-np.pi, np.pi, count)
        )
        near = near @ se3.exp(shift) @ se3.exp(turn)
        closest, _, face = renderer.mesh.closest_points(near[:, :3, 3])
        normal = renderer.mesh.face_normals[face]
        same_side = (normal * near[:, :3, 2]).sum(axis=1) > 0.7
        # back onto the surface with a new press; the tilt against the surface there is left as it is
        near[:, :3, 3] = closest - rng.uniform(*_SAMPLING.press, (count, 1)) * near[:, :3, 2]
        deepest = renderer.render(near).max(axis=(1, 2))
        good = same_side & (deepest > 0.2e-3) & (deepest < MAX_PENETRATION + 0.3e-3)
        poses = poses.copy()
        poses[-count:][good] = near[good]
        return poses

    def entries(self, group: _TouchGroup) -> np.ndarray:
        """Render maps (N, H, W) m of the codebook entries of the poses: up to half a cell away, standard press."""
        renderer, poses = group.renderer, group.poses
        moved = poses @ se3.exp(self.rng.uniform(-1, 1, (len(poses), 6)) * _CELL)
        closest, _, _ = renderer.mesh.closest_points(moved[:, :3, 3])
        moved[:, :3, 3] = closest - PRESS * moved[:, :3, 2]
        deepest = renderer.render(moved).max(axis=(1, 2)).astype(float)
        moved[:, :3, 3] += np.maximum(deepest - MAX_PENETRATION, 0)[:, None] * moved[:, :3, 2]
        return renderer.render(moved)


class _Batches(torch.utils.data.IterableDataset):
    """Endless stream of (touch inputs, entry inputs), each of one object, often a stretched one; old touches come again
    with new entries, mirrored and misread."""

    def __init__(
        self, meshes: list[ObjectMesh], backgrounds: np.ndarray, ranges: RandomisationRange, tdn: str, seed: int
    ):
        self.meshes, self.backgrounds, self.ranges, self.tdn, self.seed = meshes, backgrounds, ranges, tdn, seed

    def __iter__(self) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
        seed = self.seed + rendering_process()
        source = _Touches(self.backgrounds, self.ranges, TactileDepthNet(self.tdn), seed)
        rng = source.rng
        waiting: list[tuple[_TouchGroup, int]] = []
        while True:
            if len(waiting) < _POOL[0] or rng.random() < 1 / _REUSE:
                mesh = self.meshes[int(rng.integers(len(self.meshes)))]
                group, shown = source.group(stretched(mesh, rng) if rng.random() < 0.5 else mesh, _GROUP), 0
            else:
                group, shown = waiting.pop(int(rng.integers(len(waiting))))
            if len(group.poses) < _GROUP // 3:
                continue
            flips = tuple(axis for axis in (1, 2) if rng.random() < 0.5)
            touched = code_input(np.flip(misread(group.maps.astype(np.float32), rng), flips), source.sensor)
            entries = code_input(np.flip(source.entries(group), flips), source.sensor)
            yield torch.from_numpy(touched), torch.from_numpy(entries)
            if shown + 1 < 2 * _REUSE:
                waiting.append((group, shown + 1))
            if len(waiting) > _POOL[1]:
                waiting.pop(int(rng.integers(len(waiting))))


def contrastive_loss(touched: torch.Tensor, entries: torch.Tensor, log_temperature: torch.Tensor) -> torch.Tensor:
    """Return the InfoNCE loss in both directions for codes (N, D) of touches and their entries, both L2-normalised."""
    score = touched @ entries.T * torch.exp(-log_temperature.clamp(-4.6, 0))
    target = torch.arange(len(score), device=score.device)
    return 0.5 * (nn.functional.cross_entropy(score, target) + nn.functional.cross_entropy(score.T, target))


@dataclasses.dataclass
class _ValidationObject:
    touched: np.ndarray  # (Q, 4, 80, 60)
    entries: np.ndarray  # (Q, 4, 80, 60), one for each touch, as in training
    poses: np.ndarray  # (Q, 4, 4)
    book: np.ndarray  # (M, 4, 80, 60)
    book_poses: np.ndarray  # (M, 4, 4)


def validation_objects(data: TrainingData, tdn: TactileDepthNet, seed: int) -> list[_ValidationObject]:
    """Make touches and small codebooks of unseen objects with unseen backgrounds."""
    source = _Touches(data.held_out_backgrounds, data.ranges, tdn, seed)
    full = SensorModel.load("digit_tacto")
    out = []
    for number, mesh in enumerate(data.held_out, 1):
        print(f"touches and codebook of {mesh.name}, to validate with: {number} of {len(data.held_out)}", flush=True)
        group = source.group(mesh, _QUERIES)
        poses = codebook_poses(mesh, _BOOK, full, source.rng)
        maps = group.maps.astype(np.float32), source.entries(group), group.renderer.render(poses)
        touched, entries, book = (code_input(one, source.sensor) for one in maps)
        out.append(_ValidationObject(touched, entries, group.poses, book, poses))
    return out


@torch.no_grad()
def validate(model: nn.Module, objects: list[_ValidationObject]) -> tuple[dict[str, float], list]:
    """Return single-touch figures on unseen objects, and the scores for calibration.

    held_out: the loss on unseen objects, nats; it shows small progress soonest. top25: mean ratio of the smallest pose
    distance among the 25 best entries to that among 25 spread over the book. nll: negative mean log of the nearest
    entry's probability over the mean of all, nats.
    """
    loss, top, nll, scores = [], [], [], []
    device = next(model.parameters()).device
    temperature = float(torch.exp(model.log_temperature))
    for item in objects:
        touched, entries = (model(torch.from_numpy(maps).to(device)) for maps in (item.touched, item.entries))
        loss.append(float(contrastive_loss(touched, entries, model.log_temperature)))
        codes = touched.cpu().numpy()
        parts = np.array_split(item.book, 8)
        book = np.concatenate([model(torch.from_numpy(part).to(device)).cpu().numpy() for part in parts])
        score = codes @ book.T
        distance = geodesic_distances(item.poses[:, None], item.book_poses)
        best = np.argsort(-score, axis=1)[:, :25]
        found = np.take_along_axis(distance, best, axis=1).min(axis=1)
        by_chance = distance[:, :: max(1, distance.shape[1] // 25)][:, :25].min(axis=1)
        top.append(found.mean() / by_chance.mean())
        nearest = distance.argmin(axis=1)
        logits = score / temperature
        logits -= np.log(np.exp(logits - logits.max(1, keepdims=True)).mean(1, keepdims=True)) + logits.max(
            1, keepdims=True
        )
        nll.append(-logits[np.arange(len(nearest)), nearest].mean())
        scores.append((score, nearest))
    return {"held_out": float(np.mean(loss)), "top25": float(np.mean(top)), "nll": float(np.mean(nll))}, scores


def calibrate(scores: list) -> dict[str, float]:
    """Fit temperature T and outlier fraction e of the likelihood ratio (1 - e) exp(s/T) / mean_book exp(s/T) + e to the
    nearest entries' scores s of unseen touches, by maximum likelihood."""

    def cost(parameters: np.ndarray) -> float:
        temperature, outlier = np.exp(parameters[0]), 1 / (1 + np.exp(-parameters[1]))
        total = 0.0
        for score, nearest in scores:
            scaled = score / temperature
            highest = scaled.max(axis=1)
            level = highest + np.log(np.exp(scaled - highest[:, None]).mean(axis=1))
            ratio = np.exp(scaled[np.arange(len(nearest)), nearest] - level)
            total -= np.log((1 - outlier) * ratio + outlier).mean()
        return total / len(scores)

    best = minimize(cost, [np.log(0.07), -3.0], method="Nelder-Mead")
    temperature, outlier = float(np.exp(best.x[0])), float(1 / (1 + np.exp(-best.x[1])))
    return {"temperature": round(temperature, 5), "outlier": round(outlier, 5)}


def train(options: TrainingOptions, tdn: str = "fast") -> Path:
    """Train with the depth network `tdn` (name or ONNX path); write `tcn_fast.onnx` and `.json` into the options'
    folder; return the ONNX path. Raises InputError if `tdn` is not usable."""
    torch.manual_seed(options.seed)
    depth = TactileDepthNet(tdn)
    data = TrainingData.load(options)
    objects = validation_objects(data, depth, options.seed + 1000)
    model = CodeNet().to(options.device, memory_format=torch.channels_last)
    if options.start and not options.resume:
        batch = torch.from_numpy(np.concatenate([np.concatenate([one.touched, one.book[::16]]) for one in objects]))
        unfold(model, network_path("tcn", options.start), batch)
    run = TrainingRun(model, options, 5e-4 if options.start or options.resume else 2e-3)
    stream = _Batches(data.meshes, data.backgrounds, data.ranges, tdn, options.seed + 7919 * run.step)
    batches = rendered_batches(stream, options, ahead=4)

    def loss_of(batch: tuple[torch.Tensor, torch.Tensor]) -> torch.Tensor:
        touched, _ = batch
        both = torch.cat(batch).to(options.device).to(memory_format=torch.channels_last)
        with run.autocast:
            codes = model(both)
        codes = codes.float()
        return contrastive_loss(codes[: len(touched)], codes[len(touched) :], model.log_temperature)

    def figures() -> dict[str, float]:
        quality, _ = validate(run.averaged(CodeNet), objects)
        return {"temperature": float(model.log_temperature.detach().exp()), **quality}

    run.fit(batches, loss_of, figures, every=_EVERY)
    final = run.averaged(CodeNet)
    _, scores = validate(final, objects)
    card = {
        "network": "tcn_fast",
        "dim": final.head.out_features,
        "calibration": calibrate(scores),
        "tdn": depth.network_id,
        "data": {"meshes": len(data.meshes), "steps": run.step, "touches_a_step": _GROUP},
        **run.card("tcn"),
    }
    return export_onnx(final, {"maps": torch.zeros(1, 4, 80, 60)}, ["codes"], card, options.out / "tcn_fast.onnx")
