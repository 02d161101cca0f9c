"""Tensors of a checkpoint, fitted to the names and shapes that a network expects."""

from __future__ import annotations

import re

import numpy as np

from midastouch_common.errors import InputError

_WRAPPERS = re.compile(r"(module\.|model\.|net\.)+")  # prefixes that DataParallel and training frameworks add to names
_COUNTER = "num_batches_tracked"  # of batch normalisation; not used after training
_MOST_LISTED = 4  # of each kind of fault, in an error


def plain_names(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return `state` without batch counters, and without the prefix of wrappers if all names have the same one."""
    state = {name: values for name, values in state.items() if not name.endswith(_COUNTER)}
    prefixes = {match.group() if (match := _WRAPPERS.match(name)) else "" for name in state}
    if len(prefixes) == 1:
        (prefix,) = prefixes
        state = {name.removeprefix(prefix): values for name, values in state.items()}
    return state


def matched(state: dict[str, np.ndarray], expected: dict[str, tuple[int, ...]], what: str) -> dict[str, np.ndarray]:
    """Return `state` as float32 if its names and shapes are those of `expected` (names as `plain_names` gives them).

    Raises InputError, whose message begins with `what` and lists tensors that are missing, unexpected, of another shape
    or not finite.
    """
    faults = {
        "missing": [name for name in expected if name not in state],
        "unexpected": [name for name in state if name not in expected],
        "of wrong shape": [
            f"{name} {values.shape} instead of {expected[name]}"
            for name, values in state.items()
            if name in expected and values.shape != expected[name]
        ],
        "not numbers or not finite": [
            name for name, values in state.items() if values.dtype.kind not in "fiu" or not np.isfinite(values).all()
        ],
    }
    if any(faults.values()):
        reasons = "; ".join(f"{kind}: {_listed(names)}" for kind, names in faults.items() if names)
        raise InputError(f"{what}: {reasons}")
    return {name: np.asarray(values, np.float32) for name, values in state.items()}


def random_state(shapes: dict[str, tuple[int, ...]], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return random float32 weights, as before training, to measure speed and other figures that do not depend on them.

    Kernels (K, in, out) or (out, in, h, w) preserve the spread of their input through a ReLU (He et al. 2015);
    normalisation is near the identity; single numbers (the power of a generalised mean) are 3.
    """
    state = {}
    for name, shape in shapes.items():
        if len(shape) > 1:
            outputs = shape[0] if len(shape) == 4 else shape[-1]
            spread = np.sqrt(2 * outputs / np.prod(shape))
            values = np.float32(spread) * rng.standard_normal(shape, np.float32)
        elif shape == (1,):
            values = np.full(shape, 3.0)
        else:
            centre = 1.0 if name.endswith((".weight", "running_var")) else 0.0
            values = centre + 0.3 * np.tanh(rng.standard_normal(shape))
        state[name] = values.astype(np.float32)
    return state


def _listed(names: list[str]) -> str:
    rest = len(names) - _MOST_LISTED
    return ", ".join(names[:_MOST_LISTED]) + (f" and {rest} more" if rest > 0 else "")
