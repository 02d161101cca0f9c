"""Localiser that does not know the object: one filter runs on all objects of a catalogue."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping

import numpy as np

from ..active_touch.suggestion import Advisor
from ..core.answer import Group
from ..core.config import FilterConfig
from ..core.estimate import Estimate
from ..core.state import AMBIGUOUS, CONVERGED
from ..core.touch import Measurement
from ..filter import ParticleFilter
from ..loaded_object import LoadedObject
from ..localiser import Localiser, Start
from .catalogue import Catalogue, Entry
from .identity import UNKNOWN, Identity


class CatalogueLocaliser(Localiser):
    """Localiser on the leading object of a catalogue.

    There is no estimate until an object is more probable than `unknown`, none of them. While another object, or none,
    may be touched, the state is not `converged`. A given pose applies to every object.

    Parameters
    ----------
    catalogue
    config, seed
        As for `ParticleFilter`.
    on_object
        Called with every entry that begins to lead.
    on_identity
        Called with the identity, the gel's pose `T_base_gel` (4, 4) and the stamp [ns] whenever touches were compared.
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
        self._catalogue: Catalogue | None = catalogue
        self._on_object, self._on_identity = on_object, on_identity
        self._leading: Entry | None = None
        self._groups: list[Group] | None = None
        models = [entry.model for entry in catalogue.entries]
        self._running = running = ParticleFilter.on(models, config, seed, clock=time.perf_counter)
        largest = max(entry.mesh.diagonal for entry in catalogue.entries)
        self._object = LoadedObject(running, largest, "", catalogue.sensor, catalogue.network_id, Advisor(running))
        self._begin(None)

    @property
    def identity(self) -> Identity | None:
        """Identity of the touched object, as far as it is known; None once `set_object` has named it."""
        if self._catalogue is None:
            return None
        return Identity.of([entry.name for entry in self._catalogue.entries], self._running)

    @property
    def waiting_for(self) -> str:
        if self._catalogue is None or self._leading is not None:
            return super().waiting_for
        words = self._found.in_words()
        return f"which of {len(self._catalogue)} objects it is, is not known yet: {words}"

    def set_object(self, loaded: LoadedObject) -> None:
        """Localise on this object and ignore the catalogue."""
        self._catalogue = self._leading = self._running = None
        super().set_object(loaded)

    def _begin(self, start: Start | None) -> None:
        super()._begin(start)
        self._leading, self._groups, self._found = None, None, self.identity

    def process(
        self,
        T_base_gel: np.ndarray,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        stamp: int | None = None,
        T_gripper_gel: np.ndarray | None = None,
    ) -> Estimate | None:
        estimate = super().process(T_base_gel, measurement, others, stamp, T_gripper_gel)
        if self._catalogue is None:
            return estimate
        if (groups := self._running.groups) is not self._groups:
            self._groups, self._found = groups, self.identity
            if groups:
                self._on_identity(self._found, T_base_gel, stamp)
            self._follow()
        self.estimate = self._qualified(estimate) if self._leading is not None else None
        return self.estimate

    def _follow(self) -> None:
        """Make the object that the estimate is on the leading one."""
        running = self._running
        if not running.groups:
            self._leading = None
        elif self._leading is not None or self._found.answer != UNKNOWN:
            leading = self._catalogue.entries[running.objects.index(running.object)]
            if leading is not self._leading:
                self._leading = leading
                self._object = dataclasses.replace(self._object, diagonal=leading.mesh.diagonal, name=leading.name)
                self._on_object(leading)

    def _qualified(self, estimate: Estimate) -> Estimate:
        """Return the estimate with a status that names the competing objects. A sure pose on the leading object leaves
        no weight to other objects, but the touched object may still be none of the catalogue's."""
        status, words = estimate.status, self._found.in_words()
        if status.state == CONVERGED and self._found.answer != self._leading.name:
            status = dataclasses.replace(status, state=AMBIGUOUS, reason=f"not sure which object it is: {words}")
        else:
            status = dataclasses.replace(status, reason=f"{status.reason}; {words}")
        return dataclasses.replace(estimate, status=status)
