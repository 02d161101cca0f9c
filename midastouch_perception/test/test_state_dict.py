import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_perception.state_dict import matched, plain_names, random_state

EXPECTED = {"conv.weight": (2, 3), "conv.bias": (2,)}


def state(prefix: str = "") -> dict[str, np.ndarray]:
    return {f"{prefix}{name}": np.ones(shape) for name, shape in EXPECTED.items()}


@pytest.mark.parametrize("prefix", ["", "module.", "model.", "net.", "module.model."])
def test_wrappers_and_counters_are_dropped(prefix):
    counters = {f"{prefix}bn.num_batches_tracked": np.array(3)}
    assert plain_names(state(prefix) | counters).keys() == EXPECTED.keys()

    mixed = state(prefix) | {"other": np.ones(1)}
    assert plain_names(mixed).keys() == mixed.keys(), "only some have the prefix"


def test_what_fits_comes_as_float32_or_every_fault_is_listed():
    values = matched(state(), EXPECTED, "file")
    assert {name: (v.shape, v.dtype) for name, v in values.items()} == {
        name: (shape, np.float32) for name, shape in EXPECTED.items()
    }
    wrong = {"conv.weight": np.ones((3, 2)), "extra": np.ones(1), "other": np.full(2, np.nan)}
    with pytest.raises(InputError) as caught:
        matched(wrong, EXPECTED, "net.pth")
    said = str(caught.value)
    assert all(name in said for name in ("net.pth", "conv.bias", "extra", "other", "conv.weight", "(3, 2)", "(2, 3)"))
    with pytest.raises(InputError, match=r"layer3\b.*16 more$"):
        matched({}, {f"layer{i}": (1,) for i in range(20)}, "file")


def test_random_weights_keep_the_spread_of_what_passes():
    rng = np.random.default_rng(0)
    shapes = {"a.kernel": (27, 20, 50), "b.weight": (50, 60, 3, 3), "bn.weight": (50,), "bn.bias": (50,), "p": (1,)}
    state = random_state(shapes, rng)
    assert matched(state, shapes, "random").keys() == shapes.keys()
    for name, fan_in in (("a.kernel", 27 * 20), ("b.weight", 60 * 9)):
        assert state[name].std() == pytest.approx(np.sqrt(2 / fan_in), rel=0.02)
    assert state["bn.weight"].min() > 0.5
    assert abs(state["bn.bias"]).max() < 0.5
    assert state["p"] == 3
