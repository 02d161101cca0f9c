"""Bags of short runs, and what reads the exported files back."""

import numpy as np
import pytest
from run_results import write_run
from sequences import write_slide

from midastouch_common import se3

FRAMES = 6


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """Function that writes the bag of a run whose first frame was not answered; returns the sequence and the bag."""

    def write(name="cup", **options):
        rng = np.random.default_rng(len(name) + ord(name[-1]))
        folder = tmp_path_factory.mktemp(name)
        poses = se3.exp(rng.normal(0, 0.3, 6)) @ se3.exp(np.arange(FRAMES)[:, None] * rng.normal(0, 0.01, 6))
        images = rng.integers(0, 256, (FRAMES, 20, 15, 3), np.uint8).repeat(16, axis=1).repeat(16, axis=2)
        sequence = write_slide(folder / name / "00", images, poses)
        return sequence, write_run(sequence, folder / f"{name}.mcap", range(1, FRAMES), **options)

    return write


@pytest.fixture(scope="session")
def runs(run):
    """Paths of two bags."""
    return [run(name)[1] for name in ("cup", "can")]


@pytest.fixture(scope="session")
def parquet():
    return pytest.importorskip("pyarrow.parquet", reason="the export extra is not installed")


@pytest.fixture(scope="session")
def h5py():
    return pytest.importorskip("h5py", reason="the export extra is not installed")
