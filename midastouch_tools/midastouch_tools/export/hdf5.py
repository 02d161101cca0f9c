"""Recordings as HDF5, one file each: every column a dataset, described by attributes (docs/exports.md)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py

from .recording import FILTER_STATES, Recording

VERSION = 1
"""Version of the layout, an attribute of each file."""


def write_hdf5(recordings: Sequence[Recording], folder: Path) -> int:
    """Write `episode_000000.hdf5`, ... into `folder`; returns the number of frames."""
    count = 0
    for i, recording in enumerate(recordings):
        with h5py.File(folder / f"episode_{i:06d}.hdf5", "w") as file:
            file.attrs.update(
                format="midastouch recording",
                version=VERSION,
                object=recording.object_name,
                source="/".join(recording.path.resolve().parts[-2:]),  # all runs of a command have one file name
                filter_states=list(FILTER_STATES),
            )
            count += _write(recording, file)
    return count


def _write(recording: Recording, file: h5py.File) -> int:
    datasets = {}
    for column in recording.columns:
        shape = () if column.shape == (1,) else column.shape
        datasets[column.name] = file.create_dataset(
            column.name,
            shape=(0, *shape),
            maxshape=(None, *shape),
            dtype=column.dtype,
            # images and maps: a frame is read at a time, and most of a map is zero
            **({"chunks": (1, *shape), "compression": "gzip", "shuffle": True} if len(shape) > 1 else {}),
        )
        datasets[column.name].attrs.update(description=column.description, names=list(column.names))
    count = 0
    for count, row in enumerate(recording.rows(), 1):
        for name, dataset in datasets.items():
            dataset.resize(count, axis=0)
            dataset[count - 1] = row[name].reshape(dataset.shape[1:])
    return count
