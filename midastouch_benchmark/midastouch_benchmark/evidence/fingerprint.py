"""Fingerprint of the code that makes estimates: it stays when code is only renamed, and changes when an answer does.

    .venv/bin/midastouch fingerprint --write

It has four parts: `perception` (simulated images, networks, renderer, codebook), `slides` (simulated ones and their
images), `estimates` (all these, and the filter) and `real_gel` (the perception, and the reading of images of real gel:
calibrations, slopes, contact). Each consists of numbers that probes measure and of the values of constants.
`reports/fingerprint.json` holds today's parts under their ids. Code whose numbers agree with them has these ids, on any
machine. A number may be off by four times the change that inputs off in the sixth digit have caused, and by three times
that on another machine.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import sys
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import midastouch_common
import midastouch_filter
import midastouch_kernels
import midastouch_perception
from midastouch_common.files import atomic_path
from midastouch_filter.core.config import FilterConfig
from midastouch_tools import datasets
from midastouch_tools.result_file import read_json

from ..trials import disturbances, protocols
from . import constants
from .constants import Constants
from .probes import Probe, Probes, ProbeScene, filter_probes, perception_probes, real_gel_probes, slide_probes

ROOT = Path(__file__).resolve().parents[3]
COMMITTED = ROOT / "reports" / "fingerprint.json"
PERCEPTION, SLIDES, ESTIMATES, REAL_GEL = "perception", "slides", "estimates", "real_gel"
_DEPENDS_ON = {SLIDES: (PERCEPTION,), ESTIMATES: (PERCEPTION, SLIDES), REAL_GEL: (PERCEPTION,)}
RENEW = "midastouch fingerprint --write"
_CACHE = ROOT / "out" / "cache" / "fingerprint"
_NUDGES = 6
_REPEATS = (101, 102)  # seeds of nudges, for runs after a disagreement


@dataclass(frozen=True)
class Part:
    """Numbers and constants of one part."""

    probes: Probes
    constants: Constants

    def differences(self, other: Part) -> list[str]:
        """Return, as text, the probes and constants of this part that differ in another one; none if they agree."""
        theirs = other.probes
        lost = [name for name, probe in self.probes.items() if name not in theirs or not probe.agrees(theirs[name])]
        changed = constants.changed(self.constants, other.constants)
        return [*(f"probe '{name}'" for name in lost), *(f"constant {name}" for name in sorted(changed))]

    def to_json(self) -> dict:
        """Return the content that `from_json` reads."""
        return {"constants": self.constants, "probes": {name: each.to_json() for name, each in self.probes.items()}}

    @classmethod
    def from_json(cls, content: dict) -> Part:
        """Return the part whose content `to_json` returned."""
        return cls({name: Probe.from_json(each) for name, each in content["probes"].items()}, content["constants"])


Fingerprint = dict[str, Part]


def measure(config: FilterConfig | None = None, seed: int | None = None) -> Fingerprint:
    """Measure the code as it runs here; config: the filter's, if not its defaults; seed: of a nudge to every input."""
    both = scenes()
    rng = None if seed is None else np.random.default_rng(seed)
    return {
        PERCEPTION: Part(perception_probes(both[0], rng), constants.of_perception(both[0].networks)),
        SLIDES: Part(slide_probes(both), {}),
        ESTIMATES: Part(filter_probes(both, config or FilterConfig(), rng), constants.of_filter()),
        REAL_GEL: Part(real_gel_probes(both[0].mesh, both[0].poses, rng), constants.of_calibration()),
    }


def steady(seeds: range = range(_NUDGES)) -> Fingerprint:
    """Measure only the numbers that agree on all machines, with tolerances; takes a further run for each seed."""
    plain, others = measure(), [measure(seed=seed) for seed in seeds]
    return {
        part: Part(
            {name: probe.steadied([o[part].probes[name] for o in others]) for name, probe in one.probes.items()},
            one.constants,
        )
        for part, one in plain.items()
    }


@cache
def scenes() -> list[ProbeScene]:
    """Return the scenes that are probed, made once."""
    return [ProbeScene.of("handle_tool"), ProbeScene.of("eyebolt")]


def differences(committed: Fingerprint, *runs: Fingerprint) -> dict[str, list[str]]:
    """Return by part the differences that every run of the code has, in the part or in those that it depends on.

    runs: the first with the inputs as they are, others with nudged ones. If the last bit of a weight decides which
    hypothesis leads, one of the runs agrees; if the code has changed, none does.
    """
    changed = {}
    for part, one in committed.items():
        first, *others = (one.differences(run[part]) for run in runs)
        changed[part] = [each for each in first if all(each in other for other in others)]
    return {part: [each for one in _with_causes(part, changed) for each in changed[one]] for part in changed}


def _with_causes(part: str, there: Collection[str]) -> list[str]:
    """Return the part, after those parts of `there` on which it depends."""
    return [*(each for each in _DEPENDS_ON.get(part, ()) if each in there), part]


def ids(fingerprint: Fingerprint) -> dict[str, str]:
    """Return new ids for the parts of a fingerprint, made from their content."""
    texts = {part: json.dumps(one.to_json(), sort_keys=True) for part, one in fingerprint.items()}
    whole = {part: "".join(texts[each] for each in _with_causes(part, texts)) for part in texts}
    return {part: hashlib.sha256(text.encode()).hexdigest()[:8] for part, text in whole.items()}


def _compared(old: Fingerprint, run: Callable[[int | None], Fingerprint]) -> tuple[Fingerprint, dict[str, list[str]]]:
    """Return today's fingerprint and its changes since an old one; run: measures, with nudges of this seed, if any.

    As long as something seems to have changed, it is measured again with nudged inputs.
    """
    runs = [run(None)]
    changed = differences(old, *runs)
    for seed in _REPEATS:
        if any(changed.values()):
            runs.append(run(seed))
            changed = differences(old, *runs)
    return runs[0], changed


def write(path: Path = COMMITTED) -> dict[str, list[str]]:
    """Write the fingerprint of today's code, except parts that have not changed; return the changes by part."""
    old, named = read(path) if path.is_file() else ({}, {})
    now, changed = _compared(old, lambda seed: measure(seed=seed))
    changed |= {part: ["there was none"] for part in now if part not in old}
    if not any(changed.values()):
        return changed
    found = steady()
    names = ids(found)
    found = {part: one if changed[part] else old[part] for part, one in found.items()}
    content = {
        part: {"id": names[part] if changed[part] else named[part]} | one.to_json() for part, one in found.items()
    }
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(_lines(content)) + "\n")
    return changed


def _lines(content: dict) -> Iterator[str]:
    """Yield lines of JSON, each probe and constant on a line of its own."""
    text = json.dumps(content, indent=1)
    depth, line = 0, ""
    for row in text.splitlines():
        inner = row.strip()
        line += inner if line else row
        depth += inner.count("[") - inner.count("]")
        if depth == 0:
            yield line
            line = ""
        elif inner.endswith(","):
            line += " "


def read(path: Path = COMMITTED) -> tuple[Fingerprint, dict[str, str]]:
    """Return the fingerprint in a file, and its parts' ids."""
    content = read_json(path)
    return {part: Part.from_json(one) for part, one in content.items()}, {p: one["id"] for p, one in content.items()}


@cache
def today() -> dict[str, str]:
    """Return the ids of the parts of the code as it runs here: those of `reports/fingerprint.json` if they agree.

    They are measured once for each state of the sources, networks and models, and kept in out/cache.
    """
    if not COMMITTED.is_file():
        return ids(_measured())
    old, names = read()
    now, changed = _compared(old, _measured)
    new = ids(now)
    return {part: new[part] if changed[part] else names[part] for part in names}


def is_of_today() -> bool:
    """Return whether the committed fingerprint is that of the code as it runs here."""
    return COMMITTED.is_file() and read()[1] == today()


def of_estimates() -> str:
    """Return the id of all that a trial's estimates depend on, except its own input and settings."""
    return today()[ESTIMATES]


def _measured(seed: int | None = None) -> Fingerprint:
    path = _CACHE / f"{_sources()}{'' if seed is None else f'_{seed}'}.json"
    if path.is_file():
        return {part: Part.from_json(one) for part, one in read_json(path).items()}
    print("measuring this code's ids for the report, once: a minute or two", file=sys.stderr, flush=True)
    found = measure(seed=seed)
    with contextlib.suppress(OSError), atomic_path(path) as temporary:  # an installed package may be read-only
        temporary.write_text(json.dumps({part: one.to_json() for part, one in found.items()}))
    return found


def _sources() -> str:
    """Return a digest of every file that the numbers may depend on."""
    packages = (midastouch_common, midastouch_filter, midastouch_kernels, midastouch_perception, datasets)
    folders = [*(Path(package.__file__).parent for package in packages), Path(__file__).parent]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    files += [Path(module.__file__) for module in (disturbances, protocols)]
    digest = hashlib.sha256()
    for path in sorted(path for path in files if "__pycache__" not in path.parts):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
