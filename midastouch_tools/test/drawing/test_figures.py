import dataclasses

import numpy as np
import pytest
from PIL import Image

from midastouch_tools.drawing import figures
from midastouch_tools.drawing.run_pictures import write_gif


def test_error_series_are_in_millimetres_and_degrees(run):
    series = figures.error_series(run)
    assert series["time"] == pytest.approx([0.1 * i for i in range(12)])
    offset = np.linalg.norm(run[4].modes[0].pose[:3, 3] - run[4].truth[:3, 3])
    assert series["closest mode"][0, 4] == pytest.approx(1e3 * offset)
    assert np.isnan(series["published pose"][:, 0]).all()
    assert np.isfinite(series["published pose"][:, 1:]).all()
    assert series["particles"][1, 0] > series["particles"][1, -1]


def test_a_run_becomes_a_picture(view, run, book, tmp_path):
    path = figures.save(figures.run_figure(view, book, [run[0], run[3], run[-1]], run, "ball"), tmp_path / "a.png")
    with Image.open(path) as picture:
        assert picture.width > 900
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 1000
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_the_end_of_a_run_has_a_legend_and_a_scale(view, run):
    figure = figures.final_figure(view, run[-1], np.zeros((0, 3)))
    assert "truth" in figure.get_suptitle()
    assert [axes.texts[0].get_text() for axes in figure.axes] == ["10 mm", "1 mm"]


def test_probabilities_of_objects_are_drawn_over_time(run):
    said = [
        dataclasses.replace(one, objects={"mug": 0.1 * i, "unknown": 1 - 0.1 * i} if i else {})
        for i, one in enumerate(run[:4])
    ]
    (axes,) = figures.identity_figure(said).axes
    mug, unknown = axes.lines
    assert (mug.get_label(), unknown.get_label()) == ("mug", "unknown")
    assert mug.get_ydata() == pytest.approx([0, 10, 20, 30])
    assert unknown.get_ydata() == pytest.approx([0, 90, 80, 70])


def test_a_run_becomes_an_animation(view, run, tmp_path):
    path = write_gif(tmp_path / "a.gif", view, run, 5)
    with Image.open(path) as animation:
        assert animation.n_frames == 5
        assert animation.info["loop"] == 0


def test_a_run_without_contact_or_pose_can_be_drawn(view, run, book, tmp_path):
    blank = dataclasses.replace(run[0], code=None, modes=[], estimate=None, penetration=run[0].penetration * 0)
    figures.save(figures.run_figure(view, book, [blank], [blank, blank], "none"), tmp_path / "a.png")
    write_gif(tmp_path / "a.gif", view, [blank], 3)
