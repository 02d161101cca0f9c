"""A localiser that does not know the object: it finds out which one of a catalogue, and localises on that meanwhile."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_perception.sensor_model import SensorModel

from ..active_touch.hypotheses import MOST, Hypothesis
from ..active_touch.suggestion import Advice, Wanted, advise
from ..core.config import FilterConfig
from ..core.estimate import Estimate
from ..core.noise_model import NoiseModel
from ..core.object_model import ObjectModel
from ..core.state import AMBIGUOUS, CONVERGED
from ..core.touch import Measurement
from ..core.workers import Workers
from ..loaded_object import LoadedObject
from ..localiser import Localiser, seconds_between
from .catalogue import Catalogue, Entry
from .identification import Identification
from .identity import Identity

_KEPT_FILTERS = 2  # filters of objects that lead by turns; each has some 100 MiB


class CatalogueLocaliser(Localiser):
    """Runs the filter of the most probable object only, started at that object's best hypotheses.

    While another object may be touched, it does not call itself `converged`. As long as every object is less probable
    than that it is none of them no filter runs.

    Args: catalogue; config; seed; on_object: called with every entry that comes to lead; on_identity: with what was
    found and the gel's pose T_base_gel (4, 4) and stamp [ns].
    """

    def __init__(
        self,
        catalogue: Catalogue,
        config: FilterConfig,
        seed: int,
        on_object: Callable[[Entry], object] = lambda entry: None,
        on_identity: Callable[[Identity, np.ndarray, int | None], object] = lambda identity, T_base_gel, stamp: None,
    ):
        super().__init__(None, False)
        self._catalogue, self._config, self._seed = catalogue, config, seed
        self._on_object, self._on_identity = on_object, on_identity
        # of what the filter runs on, the catalogue is asked, not that one object
        self._filter_config = dataclasses.replace(config, unknown_prior=0.0)
        self._noise = NoiseModel.of(config)
        self._identification: Identification | None = Identification(catalogue, config, self._noise)
        self._loaded: dict[str, LoadedObject] = {}
        self._models: dict[str, ObjectModel] = {}
        self._last: np.ndarray | None = None
        self._last_stamp: int | None = None

    @property
    def identity(self) -> Identity | None:
        """What is touched, as far as it is known; None once `set_object` has named it."""
        return self._identification.identity if self._identification else None

    @property
    def sensor(self) -> SensorModel | None:
        return self._catalogue.sensor if self._identification else super().sensor

    @property
    def waiting_for(self) -> str:
        if self._identification is None or self._object is not None:
            return super().waiting_for
        return (
            f"which of {len(self._catalogue)} objects it is, is not known yet: {self._identification.found.in_words()}"
        )

    @property
    def untouched(self) -> bool:
        return super().untouched and self._last is None

    def set_object(self, loaded: LoadedObject) -> None:
        """Localise on this object, whatever the catalogue says."""
        self._identification = None
        self._loaded, self._models = {}, {}
        super().set_object(loaded)

    def restart(self) -> None:
        self._last = None
        if self._identification:
            self._identification.restart()
            if self._start is None and self._prior is None:
                self._object = None
        super().restart()

    def process(
        self,
        T_base_gel: np.ndarray,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        stamp: int | None = None,
    ) -> Estimate | None:
        if self._identification is None:
            return super().process(T_base_gel, measurement, others, stamp)
        moved = None if self._last is None else se3.inverse(self._last) @ T_base_gel
        elapsed = None if moved is None else seconds_between(self._last_stamp, stamp)
        anew = self._identification.step(moved, measurement, elapsed)
        self._last, self._last_stamp = T_base_gel, stamp
        if anew:
            identity = self._identification.identity
            self._on_identity(identity, T_base_gel, stamp)
            try:
                self._follow(identity)
            except InputError as error:  # its file is gone, or another one by now
                raise InputError(f"objects: {error}") from error
        estimate = super().process(T_base_gel, measurement, others, stamp)
        if estimate is not None:
            self.estimate = self._qualified(estimate, self._identification.found)
        return self.estimate

    def _follow(self, identity: Identity) -> None:
        """Let the filter run on the object that is the answer now, unless the last one is hardly less probable.

        While `unknown` is the answer, nothing changes: to start a filter takes as long as some hundred steps of it.
        """
        leading = identity.leading
        held = [each.probability for each in identity.objects if self._object and each.name == self._object.name]
        if identity.answer != leading.name or (held and leading.probability < self._config.hysteresis * held[0]):
            return
        entry = self._catalogue.entries[self._catalogue.number(leading.name)]
        self._object = self._loaded.pop(entry.name, None) or entry.load(self._filter_config, self._seed)
        self._loaded[entry.name] = self._object
        while len(self._loaded) > _KEPT_FILTERS:
            del self._loaded[next(iter(self._loaded))]
        self._start = self._prior = self._pending_prior = None
        self._begin(None)
        self._object.filter.initialise_hypotheses(leading.hypotheses, self._identification.window)
        self._on_object(entry)

    def _qualified(self, estimate: Estimate, identity: Identity) -> Estimate:
        """The estimate with a status that names what competes, and that is sure of no hypothesis on one object of
        many."""
        status, words = estimate.status, identity.in_words()
        if status.state == CONVERGED and identity.leading.probability < self._config.converged_probability:
            status = dataclasses.replace(status, state=AMBIGUOUS, reason=f"not sure which object it is: {words}")
        else:
            status = dataclasses.replace(status, reason=f"{status.reason}; {words}")
        return dataclasses.replace(estimate, status=status)

    def possible_poses(self) -> list[Hypothesis]:
        """Narrow hypotheses on all objects that may be, most probable first: what a next touch is to decide between.

        An object's model is made when it is first asked for, in about a second.
        """
        if self.identity is None:
            return []
        found = [(each.name, pose) for each in self.identity.objects for pose in each.hypotheses]
        doubt = 1.0 - self._config.converged_probability  # of a single object as much is left, too
        found = [each for each in found if each[1].probability >= doubt]
        self._models = {name: self._models[name] for name in self._models.keys() & {name for name, _ in found}}
        return [
            Hypothesis(self._model(name), pose.pose, pose.probability, True, name)
            for name, pose in sorted(found, key=lambda each: -each[1].probability)
        ]

    def advise(self, wanted: Wanted) -> Advice | None:
        """As a filter's on one object; while several may be, what tells them apart counts as much."""
        possible = self.possible_poses()[:MOST]
        if len({each.name for each in possible}) < 2:
            return super().advise(wanted)
        total = sum(each.probability for each in possible)
        possible = [dataclasses.replace(each, probability=each.probability / total) for each in possible]
        on = self._object.name if self._object else ""
        return advise(possible, self.measured_gels, wanted, self._noise, on)

    @property
    def measured_gels(self) -> np.ndarray:
        """(F, 4, 4) of the gels that have measured this since the last lift, in the frame of the present one."""
        return self._identification.measured_gels if self._identification else np.empty((0, 4, 4))

    def _model(self, name: str) -> ObjectModel:
        if name not in self._models:
            entry, workers = self._catalogue.entries[self._catalogue.number(name)], Workers(self._config.threads)
            self._models[name] = ObjectModel(entry.mesh, entry.codebook, self._config, self._noise, workers)
        return self._models[name]
