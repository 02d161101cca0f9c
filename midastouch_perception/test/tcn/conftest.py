"""An imported MinkLoc3D."""

from __future__ import annotations

from pathlib import Path

import pytest

from midastouch_perception.tcn import load_tcn
from midastouch_perception.tcn.minkloc3d import MinkLocCodeNet, save_minkloc3d


@pytest.fixture(scope="session")
def minkloc_file(minkloc_state, tmp_path_factory) -> Path:
    card = {"network": "tcn_minkloc3d"}
    return save_minkloc3d(minkloc_state, card, tmp_path_factory.mktemp("weights"), voxel_size=0.01)


@pytest.fixture(scope="session")
def minkloc(minkloc_file) -> MinkLocCodeNet:
    return load_tcn(minkloc_file)
