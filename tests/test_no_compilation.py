"""Nothing is compiled at run time: every inner loop is in midastouch_kernels, which the set-up builds."""

import packages

COMPILERS = {"cppyy", "llvmlite", "numba", "numexpr", "pyximport", "taichi"}
# Extras, and parts of a system ROS, which not every install has.
OPTIONAL = {"launch", "launch_ros", "onnx", "onnxscript", "openvino", "rerun", "safetensors"}
OPTIONAL |= {"h5py", "mujoco", "open3d", "pyarrow", "rtde_control", "rtde_receive", "torch"}


def test_everything_imports_where_no_compiler_can_be():
    """What a scan cannot see: an import of an import, or one inside a function that runs at import."""
    names = [name for one in packages.WITH_MODULES for name in packages.modules(one) if "__main__" not in name]
    assert len(names) > 100
    code = f"""
import importlib, importlib.abc, sys

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {COMPILERS}:
            raise ModuleNotFoundError(name + " is imported", name=name)  # where it is optional, all goes on without

sys.meta_path.insert(0, Refuse())
for name in {names}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name.split(".")[0] not in {OPTIONAL}:
            raise
"""
    assert set(packages.WITH_MODULES) <= packages.loaded_by(code)
