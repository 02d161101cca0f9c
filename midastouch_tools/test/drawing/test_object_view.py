import dataclasses
import threading

import numpy as np

from midastouch_common import se3
from midastouch_tools.drawing.object_view import ObjectView, PositionBlend


def test_the_touched_side_is_seen(view, run):
    towards_viewer = view.camera.rotation[2]
    assert all(s.truth[:3, 2] @ towards_viewer > 0.3 for s in run)


def pixel(view: ObjectView, pose: np.ndarray) -> tuple[int, int]:
    (column, row), _ = view.camera.project(pose[:3, 3])
    return int(row), int(column)


def test_particles_appear_in_position_coloured_by_their_angle(view, run):
    aside = run[0].truth.copy()
    row, column = pixel(view, aside)
    pictures = []
    for degrees in (10, 170):
        particle = aside.copy()
        particle[:3, :3] = (run[11].truth @ se3.exp(np.array([0, 0, 0, np.radians(degrees), 0, 0])))[:3, :3]
        snapshot = dataclasses.replace(run[11], particles=particle[None], modes=[])
        pictures.append(view.particles(snapshot).astype(int))
    changed = np.argwhere(np.abs(pictures[0] - pictures[1]).max(axis=-1) > 30)
    assert np.abs(changed - [row, column]).max() < 8
    assert pictures[0][row, column, 2] > pictures[0][row, column, 0] + 60  # blue
    assert pictures[1][row, column, 0] > pictures[1][row, column, 2] + 60  # red


def test_likelihood_is_reddest_where_the_touch_fits(view, run, book):
    behind = run[5].truth.copy()
    behind[:3, 3] *= -1  # the axes of the truth would cover the place
    picture = view.likelihood(book, dataclasses.replace(run[5], truth=behind)).astype(int)
    row, column = pixel(view, run[5].truth)
    rim = view.camera.project(0.0295 * view.camera.rotation[0])[0].astype(int)
    fits, rim = picture[row, column], picture[rim[1], rim[0]]
    assert fits[0] > fits[1] + 80
    assert rim[1] > fits[1] + 60  # paler


def test_without_contact_the_likelihood_is_blank(view, run, book):
    picture = view.likelihood(book, run[3]).astype(int)
    grey = np.abs(picture - picture.mean(axis=-1, keepdims=True)).max(axis=-1) < 12
    assert grey.mean() > 0.9


def test_paths_show_truth_and_estimates(view, run):
    truth = np.array([s.truth for s in run])
    with_estimate = view.paths(truth, [truth[::-1]]).astype(int)
    assert (np.abs(with_estimate - view.paths(truth, []).astype(int)) > 20).any()


def test_the_close_up_shows_contact_and_half_a_millimetre_between_truth_and_estimate(view, run):
    truth = run[-1].truth
    estimate = truth @ se3.translation([5e-4, 0, 0])
    touched = truth[:3, 3] + 5e-4 * truth[:3, 1] + 5e-4 * truth[:3, 0]
    last = dataclasses.replace(run[-1], estimate=estimate)
    picture, camera = view.close_up(last, touched[None], 10)
    assert camera.pixel_size == view.camera.pixel_size / 10
    bare, _ = view.close_up(dataclasses.replace(last, estimate=None), touched[None], 10)

    def colour(picture, point) -> np.ndarray:
        (column, row), _ = camera.project(point)
        return picture[int(row), int(column)].astype(int)

    beside = truth[:3, 3] - 5e-4 * truth[:3, 0]
    assert np.argmax(colour(bare, beside)) == 1
    red, green, blue = colour(bare, touched)
    assert red > green > blue
    above = estimate[:3, 3] + 2e-4 * estimate[:3, 1]  # on the estimate's line along y only
    red, green, blue = colour(picture, above)
    assert red > blue > green


def test_no_thread_works_on_when_the_drawing_is_interrupted(monkeypatch):
    started = []
    monkeypatch.setattr(threading.Thread, "start", lambda thread: started.append(thread))
    places = np.random.default_rng(0).normal(size=(300, 3))
    PositionBlend(places, places)
    assert not started
