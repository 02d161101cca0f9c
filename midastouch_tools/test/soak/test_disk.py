"""A disk that is full: nothing is left half written."""

from __future__ import annotations

import contextlib
import resource
from pathlib import Path

import numpy as np
import pytest

from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.bags.writer import write_bag
from midastouch_tools.datasets import write_sequence
from midastouch_tools.result_file import write_json


@contextlib.contextmanager
def no_room_beyond(size: int):
    """Any file that grows beyond `size` bytes fails, as on a full disk (EFBIG in the place of ENOSPC)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def some_sequence(path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (320, 240, 3)).astype(np.uint8)
    write_sequence(
        path,
        ((image, np.zeros((320, 240), np.float32)) for _ in range(3)),
        np.tile(np.eye(4), (3, 1, 1)),
        np.tile(np.eye(4), (3, 1, 1)),
        background=image,
        object_name="thing",
        sensor=SensorModel.load("digit_tacto"),
        noise={"sig_t": 0.0, "sig_r": 0.0},
    )


def test_a_full_disk_leaves_nothing_half_written(tmp_path, slide, simulated_sequence, figures):
    """What was there before stays, and the error names the file."""
    sequence, book = simulated_sequence(n=3), Codebook.load(slide.codebook)
    writers = {
        "book.npz": book.save,
        "result.json": lambda path: write_json(path, {"numbers": list(range(10_000))}),
        "slide.mcap": lambda path: write_bag(sequence, path),
        "bag": lambda path: write_bag(sequence, path),
        "sequence": some_sequence,
    }
    folder = tmp_path / "disk"
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    for name, write in writers.items():
        with no_room_beyond(4096), pytest.raises(OSError, match=name):
            write(folder / name)
        assert [(file.name, file.read_text()) for file in folder.iterdir()] == [("result.json", "{}")], name
    figures["full_disk"] = {"writers": list(writers), "left_behind": 0}
