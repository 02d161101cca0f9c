"""What `tdn` is started with."""

from __future__ import annotations

import cv2
import pytest
from perception_fakes import BACKGROUND, FakeDepthStage


@pytest.fixture
def background(tmp_path) -> str:
    """Path of an image of the untouched gel."""
    path = str(tmp_path / "background.png")
    cv2.imwrite(path, BACKGROUND)
    return path


@pytest.fixture
def depth() -> FakeDepthStage:
    """Stands for the network."""
    return FakeDepthStage()
