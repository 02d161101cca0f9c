"""Common parts of training runs: batches from rendering processes, a time budget, checkpoints, a log with its curve."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from safetensors.torch import load_file, save_file

import midastouch_kernels
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.stop_signals import sparing_children

from .setting import TrainingOptions

_NEWS = 20.0  # s without figures, after which the step is reported
_SETTLED = 0.5  # of the budget; after that the normalisations are fixed


def rendered_batches(dataset: torch.utils.data.IterableDataset, options: TrainingOptions, ahead: int):
    """Return a loader of the dataset's own batches that keeps `ahead` of them waiting per rendering process."""
    if not options.workers:
        return torch.utils.data.DataLoader(dataset, batch_size=None)
    return torch.utils.data.DataLoader(
        dataset,
        batch_size=None,
        num_workers=options.workers,
        prefetch_factor=ahead,
        multiprocessing_context="spawn",  # a fork copies the locks of PyTorch's and OpenCV's threads, not the threads
    )


def rendering_process() -> int:
    """Limit a rendering process to one thread; return its number, 0 in the training process."""
    worker = torch.utils.data.get_worker_info()
    if worker is None:
        return 0
    midastouch_kernels.set_threads(1)
    cv2.setNumThreads(1)
    return worker.id


class TrainingRun:
    """Optimisation with a budget, which can be resumed.

    The learning rate warms up, stays, then falls to zero by a cosine over the budget, so that a run of any length ends
    annealed. The weights kept are an exponential moving average.

    Normalisations use each batch's own statistics only in the first half of a run that begins with random weights.
    After that they are fixed, as at inference: the few sensors of a batch differ from those of the next, and weights
    that are right for each batch's own statistics are wrong for the mean of all.

    Args: model; options, of which this class uses the budget, `resume`, and `out`, the folder of
    `checkpoint.safetensors`, `state.pt` and `log.csv`; rate, the peak learning rate. Attribute: autocast, the context
    in which a network computes in bfloat16, unless the CPU lacks it and would take ten times as long.
    """

    def __init__(self, model: torch.nn.Module, options: TrainingOptions, rate: float):
        self.model, self.rate, self.folder = model, rate, Path(options.out)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._options, self.started = options, time.monotonic()
        self.optimiser = torch.optim.AdamW(model.parameters(), rate, weight_decay=1e-4)
        self.average = {k: v.detach().clone() for k, v in model.state_dict().items()}
        self.step = 0
        self.rows: list[dict] = []  # includes those of the earlier run
        self.minutes_before = 0.0
        if options.resume:
            self._resume(Path(options.resume))
        self._first_step = self.step
        self._from_scratch = options.start is None and options.resume is None
        cpu = torch.cpu.get_capabilities()
        native = options.device != "cpu" or any(cpu.get(name) for name in ("avx512_bf16", "amx_bf16", "bf16"))
        self.autocast = torch.autocast(options.device, torch.bfloat16, enabled=native)

    @property
    def progress(self) -> float:
        """Fraction of the budget used, 0 ... 1."""
        if self._options.steps:
            return min((self.step - self._first_step) / self._options.steps, 1.0)
        return min((time.monotonic() - self.started) / (60 * self._options.minutes), 1.0)

    @property
    def minutes(self) -> float:
        """Minutes of training so far, earlier runs included."""
        return self.minutes_before + (time.monotonic() - self.started) / 60

    def fit(
        self,
        batches: Iterable[Any],
        loss_of: Callable[[Any], torch.Tensor],
        validate: Callable[[], dict[str, float]],
        every: int,
    ) -> None:
        """Train until the budget is used, then plot the log.

        loss_of: returns the loss of a batch. validate: returns figures for the log; it is called every `every` steps
        and at the end.
        """
        print(f"figures and a checkpoint come every {every} steps and at the end; Ctrl-C keeps the last", flush=True)
        recent: list[float] = []
        reported = time.monotonic()
        with sparing_children():
            batches = iter(batches)  # starts the rendering processes
        for batch in batches:
            self.model.train(self._from_scratch and self.progress < _SETTLED)
            loss = loss_of(batch)
            self.update(loss)
            recent.append(float(loss.detach()))
            done = self.progress >= 1
            if self.step % every == 0 or done:
                self.record(loss=float(np.mean(recent)), **validate())
                recent.clear()
                reported = time.monotonic()
            elif time.monotonic() - reported > _NEWS:
                print(f"step {self.step}, {self.progress:.0%} of the budget", flush=True)
                reported = time.monotonic()
            if done:
                break
        _plot_log(self.rows, self.folder / "log.png")

    def card(self, network: str) -> dict:
        """Return the part of the model card of `network` (tdn or tcn) that describes its training."""
        return {
            "minutes": round(self.minutes, 1),
            "seed": self._options.seed,
            "commands": self._options.commands(network),
            "validation": {k: round(v, 4) for k, v in self.rows[-1].items()},
            "licence": "MIT",
        }

    def update(self, loss: torch.Tensor) -> None:
        """Take one optimiser step down the gradient of `loss`; a non-finite loss is skipped."""
        warm = min(1.0, (self.step + 1) / 200)
        fall = 0.5 * (1 + math.cos(math.pi * max(0.0, self.progress - 0.1) / 0.9))
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate * warm * max(fall, 1e-3)
        self.optimiser.zero_grad(set_to_none=True)
        if torch.isfinite(loss):
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
            self.optimiser.step()
        self.step += 1
        keep = min(0.999, self.step / (self.step + 20))
        with torch.no_grad():
            for name, value in self.model.named_parameters():
                self.average[name].lerp_(value, 1 - keep)
            for name, value in self.model.named_buffers():
                self.average[name].copy_(value)

    def averaged(self, build: Callable[[], torch.nn.Module]) -> torch.nn.Module:
        """Return a new model in evaluation mode with the averaged weights, on the run's device."""
        model = build().to(self._options.device)
        model.load_state_dict(self.average)
        return model.eval()

    def record(self, **figures: float) -> None:
        """Append one row to the log, print it, and save the checkpoint."""
        row = {"minutes": self.minutes, "step": self.step, **figures}
        self.rows.append(row)
        print("  ".join(f"{k} {v:.4g}" for k, v in row.items()), flush=True)
        with atomic_path(self.folder / "log.csv") as path, path.open("w", newline="") as stream:
            writer = csv.DictWriter(stream, fieldnames=list(row))
            writer.writeheader()
            writer.writerows(self.rows)
        with atomic_path(self.folder / "checkpoint.safetensors") as path:
            save_file({k: v.contiguous() for k, v in self.average.items()}, path)
        with atomic_path(self.folder / "state.pt") as path:
            torch.save(
                {"model": self.model.state_dict(), "optimiser": self.optimiser.state_dict(), "step": self.step}, path
            )

    def _resume(self, folder: Path) -> None:
        try:
            state = torch.load(folder / "state.pt", weights_only=True)
            self.model.load_state_dict(state["model"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.average = load_file(folder / "checkpoint.safetensors", self._options.device)
            self.step = state["step"]
            with (folder / "log.csv").open(newline="") as stream:
                self.rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
            for row in self.rows:
                row["step"] = int(row["step"])
            self.minutes_before = self.rows[-1]["minutes"]
        except (OSError, KeyError, RuntimeError, ValueError, IndexError) as error:
            raise InputError(f"{folder}: cannot resume from here ({error}); name the folder of a run") from error


def _plot_log(rows: list[dict], path: Path) -> None:
    """Plot curves of every logged figure over minutes, as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [k for k in rows[0] if k not in ("minutes", "step")]
    figure, axes = plt.subplots(1, len(names), figsize=(3.2 * len(names), 2.8), squeeze=False)
    for axis, name in zip(axes[0], names, strict=True):
        values = [r[name] for r in rows]
        axis.plot([r["minutes"] for r in rows], values, marker="." if len(rows) == 1 else "")
        axis.set(xlabel="minutes", title=name, yscale="log" if min(values) > 0 else "linear")
    figure.tight_layout()
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)
