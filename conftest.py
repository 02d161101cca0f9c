"""Settings for every test of the workspace.

The packages are imported here, before any test: in importlib mode pytest calls `midastouch_filter/test/x.py`
the module `midastouch_filter.test.x`, whose parent would be the folder in the workspace, not the package of
that name inside it, unless that is loaded already.
"""

from pathlib import Path

import pytest
from hypothesis import settings

import digit_driver  # noqa: F401
import midastouch_bringup  # noqa: F401
import midastouch_filter  # noqa: F401
import midastouch_kernels  # noqa: F401
import midastouch_perception  # noqa: F401

# on a busy machine time says nothing about the code
settings.register_profile("workspace", deadline=None, derandomize=True)
settings.load_profile("workspace")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of scans and slides beside the clone."""
    folder = Path(__file__).resolve().parent.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no ../shared folder beside the clone")
    return folder
