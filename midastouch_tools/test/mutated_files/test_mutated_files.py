"""Damaged files are read as they were written, or refused in one line that names them; nothing else happens.

Each format has a small good file, which is damaged by chance (seeded) and read as commands read it: without another
exception, a crash, more than 10 s of work or 2 GB, and without other content where a checksum would tell. A value of a
format without one may become another legal one. To search longer, call `fuzz.py` with another seed.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
RIGHT = {"refused", "the same", "other content", "read with a warning"}

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("count", "formats"),
    [
        (25, "ply ply_text stl stl_text obj glb off"),
        (60, "codebook codebook_beginning calibration colour_table"),
        (40, "simulated_slide real_slide trial png jpg presses"),
        (12, "bag_of_ours bag_mcap bag_sqlite bag_zstd bag_of_humble bag_without_index run"),
        (40, "sensor_model camera_model camera_info parameters symmetries measured_optics result"),
        (20, "depth_network code_network model_card"),
    ],
)
def test_mutated_files(count, formats):
    paths = [ROOT / "tests", HERE.parent / "bags", *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(HERE / "fuzz.py"), str(count), "0", *formats.split()]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    outcomes = json.loads(done.stdout)
    for name, found in outcomes.items():
        assert set(found) <= RIGHT, name
        assert found["refused"] > count / 4, "few are damaged enough"
