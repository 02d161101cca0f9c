"""A disk that is full: nothing is left half written."""

from __future__ import annotations

import contextlib
import resource

import numpy as np
import pytest
from sequences import write_slide

from midastouch_perception.codebook import Codebook
from midastouch_tools.bags.writer import write_bag
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


def test_a_full_disk_leaves_nothing_half_written(tmp_path, slide, simulated_sequence, figures):
    """What was there before stays, and the error names the file."""
    sequence, book = simulated_sequence(n=3), Codebook.load(slide.codebook)
    image = np.random.default_rng(0).integers(0, 255, (320, 240, 3)).astype(np.uint8)
    writers = {
        "book.npz": book.save,
        "result.json": lambda path: write_json(path, {"numbers": list(range(10_000))}),
        "slide.mcap": lambda path: write_bag(sequence, path),
        "bag": lambda path: write_bag(sequence, path),
        "sequence": lambda path: write_slide(path, [image] * 3, np.tile(np.eye(4), (3, 1, 1))),
    }
    folder = tmp_path / "disk"
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    for name, write in writers.items():
        with no_room_beyond(4096), pytest.raises(OSError, match=name):
            write(folder / name)
        assert [(file.name, file.read_text()) for file in folder.iterdir()] == [("result.json", "{}")], name
    figures["full_disk"] = {"writers": list(writers), "left_behind": 0}
