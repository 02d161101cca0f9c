"""Nothing is compiled at run time: every inner loop is in midastouch_kernels, which the set-up builds."""

import subprocess
import sys
from pathlib import Path

import packages

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ["midastouch_kernels", *packages.PYTHON]
COMPILERS = {"cppyy", "llvmlite", "numba", "numexpr", "pyximport", "taichi"}
# Extras, and parts of a system ROS, which not every install has.
OPTIONAL = {"launch", "launch_ros", "onnx", "onnxscript", "openvino", "rerun", "safetensors"}
OPTIONAL |= {"h5py", "mujoco", "open3d", "pyarrow", "rtde_control", "rtde_receive", "torch"}


def modules() -> list[str]:
    """Every module of the workspace's packages."""
    return [
        ".".join(path.relative_to(ROOT / package).with_suffix("").parts).removesuffix(".__init__")
        for package in PACKAGES
        for path in sorted((ROOT / package / package).rglob("*.py"))
        if path.name != "__main__.py"
    ]


def test_everything_imports_where_no_compiler_can_be():
    """What the scan cannot see: an import of an import, or one inside a function that runs at import."""
    code = f"""
import importlib, importlib.abc, sys

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {COMPILERS}:
            raise ModuleNotFoundError(name + " is imported", name=name)  # where it is optional, all goes on without

sys.meta_path.insert(0, Refuse())
for name in {modules()}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name.split(".")[0] not in {OPTIONAL}:
            raise
print(len([name for name in sys.modules if name.startswith("midastouch_")]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT / "tests")
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100
