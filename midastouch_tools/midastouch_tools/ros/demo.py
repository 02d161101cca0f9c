"""The demo from end to end: slide and codebook made, played through the real nodes over DDS, recorded, drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_bringup.parameter_files import merged, read_parameters, written
from midastouch_common.files import atomic_path, whole_folder
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import cached_codebook_path
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn

from ..bags.run_record import read_run
from ..codebooks import cached_codebook
from ..datasets import Sequence, load_sequence
from ..datasets.slide_simulation import cached_slide
from ..datasets.writer import write_image
from ..demo import NODES, SLIDE_LENGTH
from ..demo.result import demo_result, result_rows, write_page
from ..result_file import write_json
from ..text_table import text_table
from .launch_file import SHARE
from .recorded_run import record_run

CODEBOOK_SIZES = 5_000, 20_000
"""Fewest and most poses of a codebook; the most are built within a minute on two cores."""
_POSES_PER_AREA = 1e6  # 1/m^2


def run_demo(object_path: Path, out: Path, domain: int, seed: int) -> Path:
    """Run the demo on the mesh at `object_path`; returns the path of its page, `out/index.html`.

    domain: ROS_DOMAIN_ID for the nodes. Raises NodeFailed when a node dies or falls silent, InputError for
    parts that are not installed.
    """
    mesh, sensor = ObjectMesh.load(object_path), SensorModel.load("digit_tacto")
    print(f"1/5  a slide of {SLIDE_LENGTH:g} m over '{mesh.name}', simulated", flush=True)
    sequence = load_sequence(cached_slide(mesh, sensor, SLIDE_LENGTH, seed))
    size = int(np.clip(_POSES_PER_AREA * mesh.area, *CODEBOOK_SIZES))
    print(f"2/5  its codebook of {size:,} touches", flush=True)
    codebook = cached_codebook(mesh, load_tcn("fast", sensor), sensor, size)
    print(f"3/5  replay, tdn, tcn and particle_filter as processes, ROS_DOMAIN_ID={domain}", flush=True)
    with whole_folder(out, keep_failed=True) as fresh:
        bag = fresh / "run.mcap"
        with atomic_path(bag) as temporary:
            seconds = record_run(sequence, _parameters(mesh, size, sequence, fresh), temporary, fresh / "log", domain)
        write_image(bag.with_suffix(".background.png"), sequence.background)  # for a replay of it
        print(f"4/5  reading {out / bag.name}", flush=True)
        record = read_run(bag)
        print("5/5  pictures", flush=True)
        result = demo_result(record, mesh.name, seconds)
        write_json(fresh / "result.json", result)
        page = write_page(record.snapshots, mesh, codebook, result, fresh)
        print(f"\n{text_table(*result_rows(result))}\n")
    return out / page.name


def _parameters(mesh: ObjectMesh, size: int, sequence: Sequence, out: Path) -> Path:
    """Write the parameter file of all nodes: the shipped ones for recordings, with this object and its slide."""
    config = SHARE / "config"
    own: dict[str, dict] = {
        "replay": {"source": str(sequence.path.resolve()), "wait_for_subscribers": 2},
        "tdn": {"background": str(sequence.background_path.resolve())},
        "particle_filter": {
            "mesh": str(mesh.path),
            "codebook": str(cached_codebook_path(mesh.name, size).resolve()),
            "view_rate": 0.0,  # particles of every frame, for the pictures
        },
    }
    layers = [read_parameters(config / "midastouch.yaml"), read_parameters(config / "replay.yaml"), own]
    nodes = {node: merged(layers)[node] for node in (*NODES, "replay")}
    for node in NODES:
        nodes[node]["use_sim_time"] = True
    path = out / "parameters.yaml"
    path.write_text(written(nodes, ""))
    return path
