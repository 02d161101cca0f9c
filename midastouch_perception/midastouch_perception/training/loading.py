"""Batches rendered by processes beside the training."""

from __future__ import annotations

import cv2
import torch

import midastouch_kernels

from .setting import TrainingOptions


def rendered_batches(dataset: torch.utils.data.IterableDataset, options: TrainingOptions, ahead: int):
    """Loader of the dataset's own batches, `ahead` of them waiting per rendering process."""
    if not options.workers:
        return torch.utils.data.DataLoader(dataset, batch_size=None)
    return torch.utils.data.DataLoader(
        dataset,
        batch_size=None,
        num_workers=options.workers,
        prefetch_factor=ahead,
        multiprocessing_context="spawn",  # a fork has the locks of PyTorch's and OpenCV's threads, but not the threads
    )


def rendering_process() -> int:
    """Keep a rendering process to one thread of its own; returns its number, 0 in the training process."""
    worker = torch.utils.data.get_worker_info()
    if worker is None:
        return 0
    midastouch_kernels.set_threads(1)
    cv2.setNumThreads(1)
    return worker.id
