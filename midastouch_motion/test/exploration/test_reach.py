import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_motion.exploration.reach import EVERYWHERE, Reach

REACH = Reach([0, 0, 0], [1, 1, 1], np.radians(60))


def at(x, degrees=0.0):
    return se3.make(se3.exp(np.array([0, 0, 0, np.radians(degrees), 0, 0]))[:3, :3], np.array([x, 0.5, 0.5]))


@pytest.mark.parametrize(
    ("poses", "held"),
    [
        ([at(0.5)], True),
        ([at(0.5, 59)], True),
        ([at(0.5, 61)], False),
        ([at(1.1)], False),
        ([at(0.5), at(-0.1)], False),
    ],
    ids=["inside", "tilted", "too far", "beside the box", "one of two"],
)
def test_a_box_and_a_cone(poses, held):
    assert REACH.holds(np.stack(poses)) is held
    assert EVERYWHERE.holds(np.stack(poses))


def test_upright_is_within_a_cone_of_nothing():
    assert Reach([0, 0, 0], [1, 1, 1], 0.0).holds(at(0.5)[None])


def test_an_empty_box_is_refused():
    with pytest.raises(InputError, match="is empty"):
        Reach([0, 0, 0], [1, 0, 1], 1.0)
