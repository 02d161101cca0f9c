"""Load and faults over real DDS, short in the suite and long for the report.

`make soak` sets SOAK_MINUTES (of images at 60 Hz; 10 of them go with 100,000 filter steps, 1000 malformed messages of
every type and 20 loops of a bag), SOAK_REPORT (the JSON to write) and SOAK_MESH (of the object; default: eyebolt).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from slide import Slide, make_slide

from midastouch_perception.objects import bundled_objects
from midastouch_tools.machine import machine_info
from midastouch_tools.result_file import write_json


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of these tests are slow."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def minutes() -> float | None:
    """Minutes of load; None in the suite, where everything is as short as it can be."""
    given = os.environ.get("SOAK_MINUTES")
    return float(given) if given else None


@pytest.fixture(scope="session")
def figures(minutes, slide) -> Iterator[dict]:
    """What was measured, by the name of the test's subject; written when all tests have run."""
    measured: dict = {}
    yield measured
    if path := os.environ.get("SOAK_REPORT"):
        write_json(path, {"minutes": minutes, "machine": machine_info(), "object": slide.mesh.stem, **measured})


@pytest.fixture(scope="session")
def slide(tmp_path_factory) -> Slide:
    path = os.environ.get("SOAK_MESH") or bundled_objects()["eyebolt"]
    return make_slide(Path(path), tmp_path_factory.mktemp("slide"))
