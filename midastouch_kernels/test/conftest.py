"""The sheet as the kernels take it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import FOCAL, GEL_DISTANCE, HEIGHT, WIDTH, bumpy_corners


@pytest.fixture(scope="session")
def corners() -> np.ndarray:
    return bumpy_corners()


@pytest.fixture(scope="session")
def grid(corners) -> kernels.TriangleGrid:
    return kernels.TriangleGrid(corners, 2e-3)


@pytest.fixture(scope="session")
def scene(grid) -> kernels.Scene:
    gel_depth = np.full((HEIGHT, WIDTH), GEL_DISTANCE, np.float32)
    return kernels.Scene(grid, gel_depth, FOCAL, GEL_DISTANCE, 0.0)


@pytest.fixture
def threads() -> Iterator[Callable[[int], None]]:
    """Sets the number of threads for the test."""
    yield kernels.set_threads
    kernels.set_threads(0)
