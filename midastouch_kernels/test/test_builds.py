"""The same result on any number of threads; on any processor, but for rounding."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import assert_same, results

FOLDER = Path(kernels.__file__).parent


def test_any_number_of_threads_gives_the_same_bits(threads):
    threads(1)
    expected = results(kernels)
    for count in (2, 5):
        threads(count)
        for key, value in results(kernels).items():
            np.testing.assert_array_equal(value, expected[key], err_msg=key)


@pytest.mark.parametrize("build", ["_kernels", "_kernels_v3"])
def test_builds_agree(build, tmp_path):
    if build == "_kernels_v3" and f"{kernels.__name__}.{build}" not in sys.modules:
        pytest.skip("this processor does not run that build")
    file = tmp_path / "results.npz"
    subprocess.run([sys.executable, Path(__file__).with_name("sheet.py"), build, file], check=True)
    with np.load(file) as found:
        assert_same(found, results(kernels))


def test_every_build_is_installed():
    names = {path.name.split(".")[0] for path in FOLDER.glob("*.so")}
    assert names == ({"_kernels", "_kernels_v3"} if platform.machine() in ("x86_64", "AMD64") else {"_kernels"})
