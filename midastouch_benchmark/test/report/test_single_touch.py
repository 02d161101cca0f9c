import numpy as np
import pytest
import trimesh
from PIL import Image

from midastouch_benchmark.report.pictures import error_picture, overview
from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.single_touch.per_object import summarise_objects

FIGURES = (
    "normalised_top25_error", "median", "random_error", "geodesic_normalised_top25_error", "nearest_entry",
    "normalised_by_single_random",
)  # fmt: skip


@pytest.fixture
def touch(ball, tmp_path) -> dict:
    """A result for two balls, of one of which the mesh is still there; they differ in error."""
    trimesh.Trimesh(ball.vertices, ball.faces, process=False).export(tmp_path / "ball.ply")
    rng = np.random.default_rng(0)

    def entry(name: str, error: float, folder: str) -> dict:
        return {
            "object": name,
            "mesh": f"{folder}/ball.ply",
            "queries": 50,
            "missed": 1,
            "summary": dict.fromkeys(FIGURES, error),
            "exhaustive": None,
            "errors": (2 * error * rng.random(50)).tolist(),
            "cells": [[30.0 * x, 0.0, 0.0, x, 0, 0, error, 25] for x in (-1, 1)],
        }

    config = {"lighting": "random", "backgrounds": None, "networks": {"tdn": "t-1", "tcn": "c-1"}}
    objects = [entry("lost", 0.612, "/nowhere"), entry("ball", 0.234, str(tmp_path))]
    return summarise_objects(objects) | {"config": config}


@pytest.mark.slow
def test_the_section_with_its_pictures(touch, tmp_path):
    page = write_results_page([("s.json", touch)], tmp_path / "out").read_text()
    for text in ("0.234", "mean of 2 objects", "random lighting"):
        assert text in page
    for name in (f"single_touch_0{kind}.png" for kind in ("", "_ball")):
        assert f'src="{name}"' in page
        with Image.open(tmp_path / "out" / name) as picture:
            assert len(picture.convert("RGB").getcolors(1 << 24)) > 100
    assert "lost: no picture, the mesh /nowhere/ball.ply is not there" in page


def test_without_meshes_there_are_tables_only(touch, tmp_path):
    (tmp_path / "ball.ply").unlink()
    page = write_results_page([("s.json", touch)], tmp_path / "out").read_text()
    assert "0.234" in page
    assert "_ball.png" not in page


def test_places_are_red_where_the_error_is_large(ball):
    view = overview(ball, 120)
    towards_viewer, right = view.camera.rotation[2], view.camera.rotation[0]
    normals = np.stack([towards_viewer + right, towards_viewer - right, -towards_viewer])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = 30 * normals  # mm
    cells = np.hstack([places, normals, [[0.95], [0.05], [0.5]], np.ones((3, 1))])
    picture = error_picture(view, cells).astype(int)
    columns, rows = view.camera.project(1e-3 * places[:2])[0].T
    large, small = (picture[int(row), int(column)] for row, column in zip(rows, columns, strict=True))
    assert large[0] > large[2] + 50
    assert small[2] > small[0] + 50
