"""What fingers measure: which of it can be used, and what is refused by name."""

import numpy as np
import pytest
from filter_runs import model_of

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.fingers import FIRST, Fingers, by_name
from midastouch_filter.core.gates import Gates
from midastouch_filter.core.touch import Measurement

MAP = np.full((80, 60), 1e-4, np.float32)
ASIDE = se3.translation([0, 0, -0.04])


@pytest.fixture(scope="module")
def model(world, mapped_slide):
    return model_of(world, mapped_slide.codebook)


@pytest.fixture
def gates():
    return Gates()


@pytest.fixture
def fingers(model, gates):
    return Fingers(model, gates)


CODE = np.ones(64)


def touch(T_gel_finger=None, code=CODE, penetration=MAP):
    return Measurement(True, code, penetration=penetration, T_gel_finger=T_gel_finger)


def test_touches_come_with_unit_codes_the_first_fingers_first(fingers, gates):
    first, left, right = touch(code=np.full(64, 3.0)), touch(ASIDE), touch(se3.inverse(ASIDE))
    usable = fingers.usable({"right": right, "left": left, FIRST: first})
    assert [each.T_gel_finger is None for each in usable] == [True, False, False]
    np.testing.assert_allclose([np.linalg.norm(each.code) for each in usable], 1.0, rtol=1e-6)
    assert gates.note == ""


def test_what_is_in_the_air_is_no_touch(fingers, gates):
    assert fingers.usable({FIRST: Measurement(False), "left": Measurement(False, T_gel_finger=np.eye(3))}) == []
    assert gates.note == ""


def test_poses_between_fingers_are_made_rigid(fingers):
    stretched = ASIDE.copy()
    stretched[:3, :3] *= 1.0004
    (usable,) = fingers.usable({"left": touch(stretched)})
    np.testing.assert_allclose(usable.T_gel_finger[:3, :3], np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (np.full((4, 4), np.nan), "pose is not finite"),
        (2 * np.eye(4), "pose is not a rigid transform"),
        (np.eye(3), "pose of shape"),
        (se3.translation([1e300, 0, 0]), "pose is 1e+300 m from"),
        (se3.translation([0, 0, 5e-4]), "TF puts it where the first finger is"),
    ],
)
def test_finger_poses_that_are_none_are_refused(fingers, gates, pose, reason):
    assert fingers.usable({"left": touch(pose)}) == []
    assert gates.counts["bad_finger_pose"] == 1
    assert gates.note.startswith(f"finger left: {reason}")


@pytest.mark.parametrize("code", [np.full(64, np.nan), np.full(64, np.inf), np.zeros(64), np.ones(5)])
@pytest.mark.parametrize("name", [FIRST, "left"])
def test_codes_that_are_none_are_refused(fingers, gates, name, code):
    assert fingers.usable({name: touch(None if name == FIRST else ASIDE, code)}) == []
    assert gates.counts["bad_code"] == 1
    assert gates.note.startswith("finger left: code" if name else "code")


@pytest.mark.parametrize("penetration", [np.nan * MAP, np.full((80, 60), np.inf), MAP[1:], np.zeros((0, 0))])
def test_maps_that_are_none_are_refused(fingers, gates, penetration):
    assert fingers.usable({FIRST: touch(penetration=penetration), "left": touch(ASIDE)})[0].T_gel_finger is not None
    assert gates.counts["bad_relief"] == 1
    assert gates.note.startswith("penetration map")


def test_a_touch_without_a_map_waits_for_one_with(fingers, gates):
    assert fingers.usable({FIRST: touch(penetration=None)}) == []
    assert gates.note == "", "it is still to come"


def test_where_no_maps_are_compared_none_are_looked_at(world):
    gates = Gates()
    fingers = Fingers(model_of(world), gates)
    assert len(fingers.usable({FIRST: touch(penetration=None), "left": touch(ASIDE, penetration=np.zeros(3))})) == 2
    assert gates.note == ""


def test_a_further_finger_needs_a_name():
    with pytest.raises(InputError, match="needs a name"):
        by_name(Measurement(False), {FIRST: touch()})
