"""Pictures of a recorded run on a page: an animated GIF, an overview, and the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from PIL import Image

from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel

from ..bags.run_record import Snapshot, moments
from ..progress import progress_bar
from .figures import (
    LEGEND,
    MODE_COLOUR,
    PARTICLE_COLOUR,
    PENETRATION_COLOURS,
    error_series,
    final_figure,
    run_figure,
    save,
    style_error_axes,
)
from .object_view import ObjectView, measured_contact
from .page import Page
from .scale import draw_scale


def write_gif(path: Path, view: ObjectView, run: list[Snapshot], frames: int) -> Path:
    """Write up to `frames` snapshots of `run` (see `moments`) to `path`, shown for 6 s; the last one stays 2 s."""
    chosen, stage = moments(run, frames), _Stage(run, view)
    pictures = [stage.draw(each) for each in progress_bar(iterable=chosen, unit="picture", desc=path.name)]
    # One palette for all frames: no flicker, and unchanged pixels compress away. The touch is small but
    # colourful, so it gets a larger part of the sample that the palette is made from.
    sample = pictures[:: max(len(pictures) // 6, 1)]
    height, width = sample[0].shape[:2]
    touch = [p[: height // 2, int(0.63 * width) :] for p in sample]
    mixed = np.concatenate([p.reshape(-1, 3) for p in (*sample[::3], *touch, *touch)])
    mixed = mixed[: len(mixed) // width * width].reshape(-1, width, 3)
    palette = Image.fromarray(mixed).quantize(255)
    images = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    durations = [max(40, 6000 // len(images))] * (len(images) - 1) + [2000]
    with atomic_path(path) as temporary:
        images[0].save(temporary, save_all=True, append_images=images[1:], duration=durations, loop=0, optimize=False)
    return path


class _Stage:
    """The fixed parts of every frame; `draw` fills in one moment."""

    def __init__(self, run: list[Snapshot], view: ObjectView):
        self._view = view
        self._figure = Figure(figsize=(9.6, 5.2), dpi=90)
        self._canvas = FigureCanvasAgg(self._figure)
        self._scene = self._figure.add_axes((0.0, 0.04, 0.62, 0.88))
        self._image = self._figure.add_axes((0.635, 0.55, 0.16, 0.37))
        self._penetration = self._figure.add_axes((0.815, 0.55, 0.16, 0.37))
        for axes in (self._scene, self._image, self._penetration):
            axes.set_axis_off()
        self._image.set_title("tactile image", fontsize=9)
        self._penetration.set_title("penetration", fontsize=9)
        self._deepest = max(1e-4, max(float(s.penetration.max()) for s in run))
        self._series = error_series(run)
        self._marks = []
        for row, (bottom, label) in enumerate(((0.34, "mm"), (0.11, "deg"))):
            axes = self._figure.add_axes((0.69, bottom, 0.285, 0.15))
            for name, colour in (("particles", PARTICLE_COLOUR), ("closest mode", MODE_COLOUR)):
                axes.plot(self._series["time"], self._series[name][row], color=colour, lw=1.4, label=name)
            style_error_axes(axes, label, "time [s]" if row else "")
            if not row:  # above the curves, which may be anywhere
                axes.legend(frameon=False, fontsize=7, loc="lower right", bbox_to_anchor=(1, 0.95), ncols=2)
            axes.yaxis.set_major_locator(LogLocator())
            self._marks.append(axes.axvline(0, color="black", lw=1))
        draw_scale(self._scene, view.camera)
        self._figure.text(0.02, 0.015, LEGEND, fontsize=7)
        self._title = self._figure.text(0.02, 0.94, "", fontsize=12)
        self._artists: list = []

    def draw(self, snapshot: Snapshot) -> np.ndarray:
        for artist in self._artists:
            artist.remove()
        penetration = 1e3 * snapshot.penetration
        self._artists = [
            self._scene.imshow(self._view.particles(snapshot)),
            self._image.imshow(snapshot.image),
            self._penetration.imshow(penetration, cmap=PENETRATION_COLOURS, vmin=0, vmax=1e3 * self._deepest),
        ]
        for mark in self._marks:
            mark.set_xdata([snapshot.time, snapshot.time])
        self._title.set_text(f"{snapshot.time:5.1f} s   {snapshot.state}")
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


_COLUMNS = 5
_WIDTH = 760  # px
GIF_FRAMES = 60


def add_run(page: Page, table: tuple, run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, out: Path) -> None:
    """Draw the run in `run.mcap` of the folder `out` into that folder; add the pictures to a page there, and below the
    animation a `table` of header and rows."""
    view = ObjectView(mesh, np.array([s.truth for s in run]), _WIDTH)
    title = f"{mesh.name}, {len(run)} frames"
    overview = save(run_figure(view, codebook, moments(run, _COLUMNS), run, title), out / "run.png")
    # from the side that is touched at the end, which may not be the one touched most
    last, contact = run[-1], measured_contact(run[-1], SensorModel.load("digit_tacto"))
    final = save(final_figure(ObjectView(mesh, last.truth[None], _WIDTH), last, contact), out / "final.png")
    animation = write_gif(out / "run.gif", view, run, GIF_FRAMES)
    page.picture(animation, "The run from the first estimate on: particles on the object, touch, errors")
    page.table(*table)
    page.picture(overview, "Touch, its likelihood over the object, particles, errors (the paper's figure 7)")
    page.picture(final, "Particles, modes and ground truth at the end")
    page.note("run.mcap, beside this page, holds inputs, ground truth and all results. To play it there:")
    page.code("midastouch replay run.mcap")
