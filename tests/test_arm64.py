"""The kernels, cross-compiled for arm64, pass their tests and say what they say here. Runs them under qemu."""

import os
import runpy
import subprocess

import numpy as np
import pytest

import midastouch_kernels

# The tests of the kernels import each other from the package, which has to be loaded first.
PYTEST = "import sys, midastouch_kernels, pytest; sys.exit(pytest.main(sys.argv[1:]))"


@pytest.mark.slow
def test_kernels_on_arm64(load_tool, root, tmp_path):
    tool = load_tool("arm64")
    try:
        python = tool.make(tmp_path / "arm64")
    except tool.NotHereError as error:
        pytest.skip(str(error))

    def run(*arguments):
        single = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run([python, *arguments], cwd=root, env=single, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    tests = root / "midastouch_kernels" / "test"
    # Without the test that starts another Python, as qemu runs this one alone, and without what takes it minutes and
    # shows on the sheet, too.
    left = "not builds_agree and not alignment and not numbers_are"
    said = run("-c", PYTEST, tests, "--confcutdir", tests, "-p", "no:cacheprovider", "-k", left)
    assert " passed" in said
    run(tests / "sheet.py", "_kernels", tmp_path / "results.npz")
    sheet = runpy.run_path(str(tests / "sheet.py"))
    with np.load(tmp_path / "results.npz") as found:
        sheet["assert_same"](found, sheet["results"](midastouch_kernels))
