"""Named settings that are compared on the same slides: each mechanism off, fewer particles, the paper's filter."""

from __future__ import annotations

import dataclasses
import time

from midastouch_filter.config import FilterConfig
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.paper_filter import PaperConfig, PaperFilter
from midastouch_perception.codebook import Codebook
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh

from .trial import AnyFilter

DEFAULT = "default"


@dataclasses.dataclass(frozen=True)
class Variant:
    """What differs from the default: a line for tables, `FilterConfig` fields; or the paper's filter with its own."""

    summary: str
    settings: dict[str, object] = dataclasses.field(default_factory=dict)
    paper: bool = False

    def config(self, base: FilterConfig, threads: int) -> FilterConfig | PaperConfig:
        """Settings of the filter: the variant's laid over `base`."""
        if self.paper:
            return PaperConfig(**self.settings)
        return dataclasses.replace(base, **({"threads": threads} | self.settings))

    def filter(self, mesh: ObjectMesh, codebook: Codebook, base: FilterConfig, threads: int) -> AnyFilter:
        """A filter of this variant, its stages timed."""
        config = self.config(base, threads)
        if self.paper:
            return PaperFilter(mesh, codebook, config, clock=time.perf_counter, threads=threads)
        return ParticleFilter(mesh, codebook, config, clock=time.perf_counter)


VARIANTS = {
    DEFAULT: Variant("as shipped"),
    "paper": Variant("the paper's filter: softmax of cosines, resampling at every step, annealing, DBSCAN", paper=True),
    "paper_5k": Variant("the same, started with 5,000 particles", {"n_start": 5_000}, paper=True),
    "no_refinement": Variant("no alignment to the felt relief", {"refinement": False}),
    "no_hindsight": Variant("last touches are not replayed at rival places", {"hindsight": False}),
    "no_recovery": Variant("no injection when the likelihood collapses", {"recovery": False}),
    "no_kld": Variant("always 50,000 particles", {"kld_sampling": False}),
    "no_surface": Variant(
        "no surface constraint (only far particles are dropped)",
        {
            "max_penetration": 0.02,
            "max_hover": 0.02,
            "surface_sigma": 0.02,
            "dead_distance": 0.02,
            "book_constraint": False,
        },
    ),
    "no_book_constraint": Variant("particles far from every codebook pose count in full", {"book_constraint": False}),
    "projection": Variant("particles are moved back to the surface", {"project_to_surface": True}),
    "no_tempering": Variant("every touch counts in full, however near to the last", {"correlation_length": 1e-5}),
    "no_smoothing": Variant("the likelihood of the nearest codebook entry alone", {"smoothing_neighbours": 0}),
    "no_annealing": Variant("full noise floor after convergence too", {"noise_converged": 1.0}),
    "no_rest_gate": Variant("an arm at rest is updated too", {"update_min_d": 0.0, "update_min_a": 0.0}),
    "no_size_gate": Variant("resampling at every touch", {"resample_ess": 1.0}),
    "1k": Variant("at most 1,000 particles", {"max_particles": 1_000}),
    "5k": Variant("at most 5,000 particles", {"max_particles": 5_000}),
    "10k": Variant("at most 10,000 particles", {"max_particles": 10_000}),
}

SETS = {
    "counts": ("1k", "5k", "10k"),
    "ablation": (*(name for name in VARIANTS if name.startswith("no_")), "projection"),
}
"""Names for several variants at once; "all" is every one."""


def chosen_variants(names: list[str]) -> list[str]:
    """Variants by name or by the name of a set, the default first, none twice; InputError for an unknown name."""
    chosen = [DEFAULT]
    for name in names:
        if name == "all":
            chosen += VARIANTS
        elif name in SETS:
            chosen += SETS[name]
        elif name in VARIANTS:
            chosen.append(name)
        else:
            known = ", ".join([*VARIANTS, *SETS, "all"])
            raise InputError(f"--variant {name}: not known; there are {known}")
    return list(dict.fromkeys(chosen))
