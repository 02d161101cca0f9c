"""What `midastouch_perception` and `midastouch_filter` export, and what importing them costs."""

import importlib

import pytest
from packages import loaded_by

PACKAGES = ["midastouch_perception", "midastouch_filter"]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there(package):
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name).__module__.startswith((f"{package}.", "midastouch_common."))


@pytest.mark.parametrize("package", PACKAGES)
def test_the_import_alone_loads_no_library(package):
    loaded = loaded_by(f"import {package}")
    assert package in loaded
    assert not {"numpy", "scipy", "cv2", "onnxruntime", "torch", "rclpy", "midastouch_kernels"} & loaded
