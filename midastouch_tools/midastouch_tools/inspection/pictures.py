"""Moments of a run drawn off screen, by Open3D's renderer over OpenGL: no display is needed."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh

from ..progress import progress_bar
from . import require_open3d
from .geometry import Viewpoint, geometry_of, mesh_geometry, shapes
from .run import Run

_WIDTH, _HEIGHT = 1280, 960
_SAMPLES = 2  # drawn along each side of a pixel
_MARGIN = 0.1  # of the picture, on each side
_NARROW = -90.0  # deg; narrows the field of view to its smallest: nearly parallel rays
_SINKS = 3e-3  # m; shapes up to this deep below the surface are drawn as if on it
_HIDDEN = 0.3  # opacity of deeper shapes


def save(run: Run, mesh: ObjectMesh, paths: dict[int, Path]) -> None:
    """Draw moments into PNG files, {moment: path}. Raises InputError as `Pictures`, and for another kind of file."""
    for path in paths.values():
        if path.suffix != ".png":
            raise InputError(f"{path}: pictures are .png files")
    with Pictures(run, mesh) as pictures, progress_bar(total=len(paths), unit="picture") as bar:
        for index, path in paths.items():
            with atomic_path(path) as temporary:
                Image.fromarray(pictures.draw(index)).save(temporary)
            bar.update()


class Pictures:
    """Pictures of a run, all from the same side; `with` frees the renderer. Raises InputError without OpenGL.

    Particles and contact points lie a little inside the object, so its mesh would hide them: the mesh and the rest are
    drawn separately and combined by their depths.
    """

    def __init__(self, run: Run, mesh: ObjectMesh):
        o3d = require_open3d()
        self._run = run
        self._renderer = o3d.visualization.Visualizer()
        if not self._renderer.create_window(width=_SAMPLES * _WIDTH, height=_SAMPLES * _HEIGHT, visible=False):
            raise InputError("Open3D finds no OpenGL to draw with; install libegl1 and libgl1-mesa-dri")
        options = self._renderer.get_render_option()
        options.background_color = np.ones(3)
        options.light_on = True
        options.point_size, options.line_width = 4.0 * _SAMPLES, 2.0 * _SAMPLES
        self._renderer.add_geometry(mesh_geometry(mesh))
        self._aim(Viewpoint.of(run, mesh), mesh)
        self._bare, self._surface = self._drawn()

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.destroy_window()

    def draw(self, index: int) -> np.ndarray:
        """Draw the picture (960, 1280, 3) uint8 of a moment."""
        self._renderer.clear_geometries()
        for shape in shapes(self._run.moments, index).values():
            self._renderer.add_geometry(geometry_of(shape), reset_bounding_box=False)
        drawn, depth = self._drawn()
        in_front = (self._surface == 0) | (depth < self._surface + _SINKS)
        opacity = np.where(depth == 0, 0.0, np.where(in_front, 1.0, _HIDDEN))[..., None]
        blended = (255 * (opacity * drawn + (1 - opacity) * self._bare)).astype(np.uint8)
        picture = cv2.resize(blended, (_WIDTH, _HEIGHT), interpolation=cv2.INTER_AREA)
        text = f"{self._run.name}: {self._run.moments[index].label}"
        return cv2.putText(picture, text, (24, 44), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (40, 40, 40), 2, cv2.LINE_AA)

    def _aim(self, viewpoint: Viewpoint, mesh: ObjectMesh) -> None:
        control = self._renderer.get_view_control()
        control.change_field_of_view(_NARROW)
        control.set_lookat(viewpoint.centre)
        control.set_front(viewpoint.towards_viewer)
        control.set_up(viewpoint.up)
        seen = np.ptp(mesh.vertices @ np.stack([viewpoint.right, viewpoint.up]).T, axis=0)
        # The zoom is half the visible height, in units of the longest side of the object's box.
        height = max(seen[1], seen[0] * _HEIGHT / _WIDTH) / (1 - 2 * _MARGIN)
        control.set_zoom(0.5 * height / np.ptp(mesh.bounds, axis=0).max())

    def _drawn(self) -> tuple[np.ndarray, np.ndarray]:
        """Return colours (H, W, 3) in [0, 1] and depths (H, W) m, 0 for the background."""
        self._renderer.poll_events()
        self._renderer.update_renderer()
        colours = np.array(self._renderer.capture_screen_float_buffer(do_render=True))
        return colours, np.array(self._renderer.capture_depth_float_buffer(do_render=True))
