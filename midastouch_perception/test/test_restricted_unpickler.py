import collections
import pickle

import pytest

from midastouch_common.errors import InputError
from midastouch_perception.restricted_unpickler import RestrictedUnpickler


def load(data: bytes) -> object:
    return RestrictedUnpickler(data, {"collections.OrderedDict": list}, "only dicts are read").load()


def test_listed_names_become_their_stand_ins():
    assert load(pickle.dumps(["plain", collections.OrderedDict()])) == ["plain", []]


def test_other_names_are_refused_by_name():
    with pytest.raises(InputError, match=r"builtins\.eval"):
        load(pickle.dumps(eval, 4))


def test_a_memo_beyond_the_data_is_refused_before_it_is_made():
    with pytest.raises(InputError, match="memo"):
        load(b"Nr\xff\xff\xff\xff.")
