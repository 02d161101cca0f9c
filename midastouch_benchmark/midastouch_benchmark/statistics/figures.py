"""Figures over trials: shares, and statistics of what differs from trial to trial, each with its 95 % interval."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np

from .intervals import bootstrap_interval, share_interval


class Figures:
    """Figures over trials, one number of each; groups (N,): which trials belong together, as of `share_interval`."""

    def __init__(self, groups: Sequence[Hashable]):
        self._groups = groups

    @classmethod
    def by_slide(cls, trials: Sequence[dict]) -> Figures:
        """Trials on one slide over an object are not independent."""
        return cls([(trial["object"], trial["slide"]) for trial in trials])

    def share(self, part: Sequence[float], whole: Sequence[float] | None = None) -> dict:
        """{"share", "interval"}: what `part` is of `whole`, both summed; of all trials if that is not given."""
        whole = np.ones(len(part)) if whole is None else whole
        total = float(np.sum(whole))
        return {
            "share": float(np.sum(part)) / total if total else None,
            "interval": share_interval(part, whole, self._groups),
        }

    def value(self, some: Sequence[float], statistic: Callable[..., np.ndarray]) -> dict:
        """{"value", "interval"}: `np.mean` or `np.median` of what is not nan."""
        some = np.array(some, float)
        known = some[~np.isnan(some)]
        return {
            "value": float(statistic(known)) if len(known) else None,
            "interval": bootstrap_interval(some, self._groups, statistic),
        }

    def values(self, some: Sequence[float]) -> dict:
        """Mean and median."""
        return {"mean": self.value(some, np.mean), "median": self.value(some, np.median)}
