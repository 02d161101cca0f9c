"""A catalogue with room for two objects of three at a time: which these are changes with what is measured."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.keyframes import KeyframeWindow
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import Measurement
from midastouch_filter.identification.catalogue import Catalogue
from midastouch_filter.identification.coarse_index import CoarseIndex, typical_codes
from midastouch_filter.identification.compared_objects import ComparedObjects
from midastouch_filter.identification.identification import Identification
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_perception.codebook import Codebook

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)


@pytest.fixture(scope="module")
def crowded(shelf):
    return Catalogue(shelf.catalogue.entries, room=6000)


def identification(catalogue, frames):
    out = Identification(catalogue, CONFIG, NOISE)
    slide(out, frames)
    return out


def slide(identification, frames):
    for moved, touch in frames:
        identification.step(moved, touch)


def test_what_touches_speak_for_is_compared_and_found(shelf, crowded):
    truth, frames = shelf.touches(2)
    out = identification(crowded, frames)
    assert Identification(crowded, CONFIG, NOISE).compared.names == {"bumpy_1", "bumpy_2"}
    assert "bumpy_3" in out.compared.names
    assert len(out.compared.names) == 2
    assert out.identity.answer == "bumpy_3"
    assert np.linalg.norm(out.identity.leading.hypotheses[0].pose[:3, 3] - truth[-1][:3, 3]) < 2e-3
    assert {each.name for each in out.identity.objects} == {"bumpy_1", "bumpy_2", "bumpy_3"}
    assert sum(each.probability for each in out.identity.objects) + out.identity.unknown == pytest.approx(1.0)


def test_what_is_in_no_catalogue_is_unknown(shelf, crowded):
    _, frames = shelf.touches(1)
    assert identification(crowded.without("bumpy_2"), frames).identity.answer == UNKNOWN


def test_an_object_without_room_of_its_own_is_compared_alone(shelf):
    _, frames = shelf.touches(2, steps=60)
    assert len(identification(Catalogue(shelf.catalogue.entries, room=1), frames).compared.names) == 1


def test_with_room_for_all_nothing_is_chosen(shelf):
    _, frames = shelf.touches(1, steps=40)
    entries = shelf.catalogue.entries
    enough = Catalogue(entries, room=sum(entry.size for entry in entries))
    out = identification(enough, frames)
    assert out.compared.numbers == [0, 1, 2]
    assert out.identity.in_words() == identification(shelf.catalogue, frames).identity.in_words()


def test_a_codebook_that_is_gone_is_named_and_the_touches_are_forgotten(shelf, tmp_path):
    objects = []
    for entry in shelf.catalogue.entries:
        path, book = (tmp_path / f"{entry.name}{ending}" for ending in (".ply", ".npz"))
        entry.mesh.save(path)
        mesh = ObjectMesh.load(path)
        meta = {"format": 1, "mesh_name": mesh.name, "mesh_sha256": mesh.sha256, "sensor_id": ""}
        Codebook(entry.codebook.poses, entry.codebook.codes, entry.meta | meta).save(book)
        objects.append((mesh, Codebook.load(book), book))
    out = Identification(Catalogue.of(objects, NOISE, room=6000), CONFIG, NOISE)
    book.unlink()
    _, frames = shelf.touches(2)
    with pytest.raises(InputError, match=r"bumpy_3\.npz"):
        slide(out, frames)
    assert not len(out.window)
    assert out.identity.unknown == 0.5
    out.step(*frames[0])


POSES, OBJECTS, ROOM = 200, 20, 14


@pytest.fixture(scope="module")
def many(world):
    """Objects of codes that are all their own, and room for most of them."""
    rng = np.random.default_rng(0)
    objects = []
    for k in range(OBJECTS):
        mesh = ObjectMesh.from_arrays((1 + 0.02 * k) * world.mesh.vertices, world.mesh.faces, f"object_{k}")
        codes = rng.standard_normal(16) + 0.5 * rng.standard_normal((POSES, 16))
        codes /= np.linalg.norm(codes, axis=1, keepdims=True)
        meta = {"sensor": "digit_tacto", "tcn": "test", "temperature": 0.1, "outlier": 0.05}
        objects.append((mesh, Codebook(world.poses[:POSES], codes, meta), None))
    return Catalogue.of(objects, NOISE, room=ROOM * POSES)


def measured(catalogue, compared, window, k, count=6):
    """Slide on over object k."""
    for code in catalogue.entries[k].codebook.codes[:count]:
        touch = Measurement(True, code)
        window.moved(se3.exp([0.01, 0, 0, 0, 0, 0]), 0.01, in_contact=True)
        window.keep([touch], [compared.scores.log_ratio_of(touch)])


def test_an_object_that_was_ruled_out_comes_back(many):
    compared, window = ComparedObjects(many, CONFIG, NOISE), KeyframeWindow(32, 5e-3, NOISE.touch_correlation, 80)
    assert compared.numbers == list(range(ROOM))
    gone, back = set(), set()
    for _ in range(8):
        k = max(set(range(OBJECTS)) - set(compared.numbers), key=lambda number: number in gone)
        before = set(compared.numbers)
        measured(many, compared, window, k)
        list(compared.choose(window, held=[5]))
        assert {k, 5} <= set(compared.numbers)
        assert len(compared.numbers) == ROOM
        assert all(len(each.log_ratios[0]) == ROOM * POSES for each in window.keyframes)
        best = window.keyframes[-1].log_ratios[0].argmax()
        assert compared.numbers[best // POSES] == k
        window.restart()
        gone |= before - set(compared.numbers)
        back |= {k} & gone
    assert back


def test_as_long_as_others_are_improbable_nothing_is_scored_anew(many):
    compared, window = ComparedObjects(many, CONFIG, NOISE), KeyframeWindow(32, 5e-3, NOISE.touch_correlation, 80)
    measured(many, compared, window, 17)
    list(compared.choose(window, held=[]))
    assert 17 in compared.numbers
    before = window.keyframes
    list(compared.choose(window, held=[]))
    assert window.keyframes is before


def test_touches_that_come_while_others_are_read_are_scored_too(many):
    compared, window = ComparedObjects(many, CONFIG, NOISE), KeyframeWindow(32, 5e-3, NOISE.touch_correlation, 80)
    measured(many, compared, window, 17)
    running = compared.choose(window, held=[])
    next(running)
    measured(many, compared, window, 17, count=9)
    list(running)
    touch = window.keyframes[-1].touches[0]
    assert 17 in compared.numbers
    assert np.array_equal(window.keyframes[-1].log_ratios[0], compared.scores.log_ratio_of(touch).astype(np.float16))


def codes_of(seed, count=2000, kinds=20, dim=16):
    """Codes of an object that measures like `kinds` different things."""
    rng = np.random.default_rng(seed)
    codes = rng.standard_normal((kinds, dim))[rng.integers(kinds, size=count)] + 0.1 * rng.standard_normal((count, dim))
    return (codes / np.linalg.norm(codes, axis=1, keepdims=True)).astype(np.float32)


def test_every_code_is_near_a_typical_one():
    codes = codes_of(0)
    typical = typical_codes(codes)
    assert len(typical) <= 128
    assert np.linalg.norm(typical, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert (codes @ typical.T).max(axis=1).min() > 0.95
    assert np.array_equal(typical, typical_codes(codes))


def test_an_object_of_few_poses_has_as_many_typical_codes():
    assert len(typical_codes(codes_of(0, count=5, kinds=5))) == 5


def test_touches_speak_for_the_object_that_is_like_them():
    objects = [codes_of(seed) for seed in range(6)]
    index = CoarseIndex([typical_codes(codes) for codes in objects], temperature=0.06, outlier=0.04)
    for k, codes in enumerate(objects):
        log_ratios = index.log_ratios(codes[:50])
        assert log_ratios.shape == (6, 50)
        assert (log_ratios.argmax(axis=0) == k).mean() > 0.9
        assert log_ratios.min() == pytest.approx(np.log(0.04), abs=0.1)
        assert log_ratios.max() <= np.log(6)
