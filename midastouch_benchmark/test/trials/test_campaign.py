from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from midastouch_benchmark.trials.cache import SlideKind, Touches
from midastouch_benchmark.trials.campaign import Plan
from midastouch_benchmark.trials.variants import BUDGET, VARIANTS, Variant
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.symmetry.search import ObjectSymmetry
from midastouch_tools.jobs import Workers


@dataclass(frozen=True)
class StubCache:
    """A cache without files, over one slide."""

    sequence: object
    book: object
    networks: object
    folder: Path
    codebook_size: int = 4000
    slides: SlideKind = field(default_factory=lambda: SlideKind(0.045))

    def describe(self):
        return self.networks.describe()

    def codebook(self, mesh, size=None):
        return type(self.book)(self.book.poses[:size], self.book.codes[:size], self.book.meta)

    def codebook_digest(self, mesh, size=None):
        return str(size or len(self.book.poses))

    def touches(self, mesh, number):
        return self.sequence, Touches.perceive(self.sequence, self.networks)

    def frames(self, mesh, number, stride=1):
        return self.touches(mesh, number)[1].frames(self.sequence, stride)

    def symmetry(self, mesh):
        return ObjectSymmetry()


@pytest.fixture(scope="module")
def saved_mesh(mesh, tmp_path_factory) -> ObjectMesh:
    path = tmp_path_factory.mktemp("meshes") / "block.ply"
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    return ObjectMesh.load(path)


@pytest.fixture
def plan(sequence, codebook, networks, tmp_path) -> Plan:
    return Plan(
        StubCache(sequence, codebook, networks, tmp_path),
        FilterConfig(max_particles=1000),
        ("default", "no_drift"),
        ("paper",),
        slides=(0,),
        seeds=(0, 1),
        stride=3,
    )


@pytest.mark.slow
def test_every_combination_is_run_once(plan, saved_mesh, bars):
    trials, missing = plan.run([saved_mesh], Workers())
    assert missing == 0
    assert {(t["variant"], t["seed"]) for t in trials} == {
        ("default", 0), ("default", 1), ("no_drift", 0), ("no_drift", 1),
    }  # fmt: skip
    assert all(t["sequence"] == "block/00" and t["frames"] == 10 and "per_frame" not in t for t in trials)
    assert [(bar.total, bar.n) for bar in bars] == [(4, 4)]
    # again: nothing is left to do
    again, _ = plan.run([saved_mesh], Workers())
    assert [bar.total for bar in bars] == [4, 0]
    assert again == trials
    # other settings are other trials
    other = replace(plan, config=replace(plan.config, tested_poses=301))
    assert other.run([saved_mesh], Workers(), deadline=0)[1] == 4


def test_nothing_is_started_after_the_time_given(plan, saved_mesh):
    trials, missing = plan.run([saved_mesh], Workers(), deadline=0)
    assert (trials, missing) == ([], 4)


@pytest.mark.slow
def test_a_variant_may_have_another_codebook_and_no_codes(plan, saved_mesh, monkeypatch):
    monkeypatch.setitem(VARIANTS, "few_poses", Variant("500 poses", BUDGET, codebook_size=500))
    seen = []
    make = Variant.filter

    def spy(variant, mesh, codebook, base, threads):
        seen.append((len(codebook.codes), len(np.unique(codebook.codes)) == 1))
        return make(variant, mesh, codebook, base, threads)

    monkeypatch.setattr(Variant, "filter", spy)
    plan = replace(plan, variants=("few_poses", "no_codes"), seeds=(0,))
    trials, missing = plan.run([saved_mesh], Workers())
    assert (missing, seen) == (0, [(500, False), (4000, True)])
    assert all(t["frames_in_contact"] == 10 for t in trials)
    # and they are other trials than the default's
    variants = [trials[0] | {"variant": name} for name in ("default", "no_codes")]
    assert len({plan.key(saved_mesh, None, "", labels) for labels in variants}) == 2


def test_touches_of_another_foreign_object_are_another_trial(plan, saved_mesh, tool):
    plan, labels = replace(plan, protocol="wrong_mesh"), {"variant": "default"}
    assert plan.key(saved_mesh, tool, "", labels) != plan.key(saved_mesh, saved_mesh, "", labels)


def test_a_protocol_disturbs_the_frames(plan, saved_mesh):
    plan = replace(plan, variants=("default",), seeds=(0,))
    plain, _ = plan.run([saved_mesh], Workers())
    lifted, _ = replace(plan, protocol="lift").run([saved_mesh], Workers())
    assert (plain[0]["protocol"], lifted[0]["protocol"]) == ("plain", "lift")
    assert plain[0]["frames_in_contact"] == plain[0]["frames"]
    assert lifted[0]["frames"] - lifted[0]["frames_in_contact"] == 10
    assert plain[0]["event_at"] is None
    assert lifted[0]["event_at"] in (12, 13, 14)
