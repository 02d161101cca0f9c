"""Localise a recorded slide from Python, without ROS.

midastouch simulate handle_tool --seed 3 --out out/slide
midastouch build-codebook handle_tool
python examples/localise_offline.py out/slide

For an object of your own, name its mesh and codebook, too:

python examples/localise_offline.py out/part_slide part.ply out/codebooks/part.npz
"""

import inspect
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_filter import Estimate, ParticleFilter, measurement_of
from midastouch_perception import Codebook, ObjectMesh, TouchPipeline, bundled_objects, load_tcn, load_tdn
from midastouch_tools.datasets import Sequence, load_sequence
from midastouch_tools.processes.foreground import ended_by_signals

HANDLE_TOOL = bundled_objects()["handle_tool"]


def localise(slide: Sequence, pipeline: TouchPipeline, particle_filter: ParticleFilter) -> Iterator[Estimate]:
    """Yield the estimate of each frame; `poses_measured` may be gel poses in any frame in which the object rests."""
    background, poses = slide.background, slide.poses_measured
    particle_filter.initialise_uniform()  # nothing is known of the start
    for i in range(slide.n_frames):
        touch = pipeline.process(slide.image(i), background)
        odometry = np.linalg.inv(poses[i - 1]) @ poses[i] if i else None
        yield particle_filter.step(odometry, measurement_of(touch))


def run(main: Callable[..., None], manual: str) -> None:
    """Call the main function of an example with its command-line arguments; print the manual if it is asked for, after
    an InputError, or for arguments that it does not have."""
    words = sys.argv[1:]
    if {"-h", "--help"} & {*words}:
        print(manual)
        return
    if any(word.startswith("-") for word in words) or len(words) > len(inspect.signature(main).parameters):
        sys.exit(manual)
    try:
        with ended_by_signals():
            main(*words)
    except InputError as error:
        sys.exit(f"{error}\n\n{manual}")


def main(
    folder: str = "out/slide",
    mesh_path: Path = HANDLE_TOOL,
    codebook_path: str = "out/codebooks/handle_tool.npz",
) -> None:
    """Print the state and the error of the published pose, every ten frames."""
    slide, mesh = load_sequence(folder), ObjectMesh.load(mesh_path)
    print(f"{folder}, a slide over {slide.object_name}, localised on {mesh.name}")
    particle_filter = ParticleFilter(mesh, Codebook.load(codebook_path, mesh))
    symmetry = particle_filter.objects[0].symmetry.exact
    pipeline = TouchPipeline(load_tdn(), load_tcn(), time.perf_counter)
    for i, estimate in enumerate(localise(slide, pipeline, particle_filter)):
        if i % 10 == 0:
            alike = symmetry.nearest(estimate.pose[None], slide.poses_true[i])[0]  # of poses that no touch tells apart
            error = np.linalg.norm(alike[:3, 3] - slide.poses_true[i, :3, 3])
            print(f"{i:4d} {estimate.status.state:10s} {1e3 * error:6.1f} mm  {estimate.status.reason}")


if __name__ == "__main__":
    run(main, __doc__)
