"""Window of a run: the object, which you can turn, a slider for the time, and a choice of layers."""

from __future__ import annotations

import os
import time

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from . import require_open3d
from .geometry import LAYERS, Viewpoint, geometry_of, mesh_geometry, shapes
from .run import Run

_FIELD_OF_VIEW = 20.0  # deg
_PLAYED_S = 0.05  # from one moment to the next
_UNSEEN = 3  # first pictures, which may not reach the screen
_LIGHT = 80_000  # lux, from all sides
_EM = 0.5  # spacing, of the font's size


def show(run: Run, mesh: ObjectMesh, index: int) -> None:
    """Open the window at a moment; returns when it is closed. Raises InputError without a display."""
    o3d = require_open3d()
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("no display to open a window on; draw to files with --save")
    app = o3d.visualization.gui.Application.instance
    app.initialize()
    try:
        Window(run, mesh, index)
    except RuntimeError as error:
        raise InputError(
            f"Open3D cannot open a window ({error}); it wants Vulkan (libvulkan1, and the driver of the graphics card "
            "or mesa-vulkan-drivers), or draw to files with --save"
        ) from error
    app.run()


class Window:
    """The window of a run; lives as long as Open3D's application runs."""

    def __init__(self, run: Run, mesh: ObjectMesh, index: int):
        o3d = require_open3d()
        self._gui, self._rendering = o3d.visualization.gui, o3d.visualization.rendering
        self._run, self._index = run, index
        self._layers = dict.fromkeys(LAYERS, True)
        self._played_at = 0.0
        self._unseen = _UNSEEN
        self._window = self._gui.Application.instance.create_window(f"midastouch: {run.name}", 1280, 900)
        self._scene = self._gui.SceneWidget()
        self._scene.scene = self._rendering.Open3DScene(self._window.renderer)
        self._scene.scene.set_background([1.0, 1.0, 1.0, 1.0])
        # Photographic effects would cost tens of seconds per picture without a graphics card.
        view = self._scene.scene.view
        for switch in (view.set_post_processing, view.set_antialiasing, view.set_ambient_occlusion, view.set_shadowing):
            switch(False)
        self._scene.scene.scene.set_indirect_light_intensity(_LIGHT)
        self._scene.scene.add_geometry("mesh", mesh_geometry(mesh), self._material("defaultLitTransparency", 0.6))
        self._look(Viewpoint.of(run, mesh), mesh)
        self._panel = self._make_panel()
        self._window.add_child(self._scene)
        self._window.add_child(self._panel)
        self._window.set_on_layout(self._layout)
        self._window.set_on_tick_event(self._tick)
        self.show(index)

    def show(self, index: int) -> None:
        """Draw a moment."""
        self._index = self._slider.int_value = index
        self._label.text = self._run.moments[index].label
        drawn = shapes(self._run.moments, index)
        scene = self._scene.scene
        for name in LAYERS:
            if scene.has_geometry(name):
                scene.remove_geometry(name)
            if name in drawn and self._layers[name]:
                shader = "defaultUnlit" if drawn[name].lines is None else "unlitLine"
                scene.add_geometry(name, geometry_of(drawn[name]), self._material(shader))
        self._scene.force_redraw()
        self._window.post_redraw()

    def _material(self, shader: str, opacity: float = 1.0):
        material = self._rendering.MaterialRecord()
        material.shader, material.base_color = shader, [1.0, 1.0, 1.0, opacity]
        material.point_size, material.line_width = 4 * self._window.scaling, self._window.scaling
        return material

    def _look(self, viewpoint: Viewpoint, mesh: ObjectMesh) -> None:
        box = self._scene.scene.bounding_box
        self._scene.setup_camera(_FIELD_OF_VIEW, box, viewpoint.centre)
        eye = viewpoint.centre + 2.5 * mesh.diagonal * viewpoint.towards_viewer
        self._scene.look_at(viewpoint.centre, eye, viewpoint.up)

    def _make_panel(self):
        gui, space = self._gui, _EM * self._window.theme.font_size
        panel = gui.Vert(space, gui.Margins(space, space, space, space))
        self._label = gui.Label("")
        self._slider = gui.Slider(gui.Slider.INT)
        self._slider.set_limits(0, max(1, len(self._run.moments) - 1))
        self._slider.set_on_value_changed(lambda value: self.show(min(int(value), len(self._run.moments) - 1)))
        row = gui.Horiz(space)
        self._play = gui.ToggleSwitch("play")
        row.add_child(self._play)
        for name in LAYERS:
            box = gui.Checkbox(name)
            box.checked = True
            box.set_on_checked(lambda checked, name=name: self._toggle(name, checked))
            row.add_child(box)
        for part in (self._label, self._slider, row):
            panel.add_child(part)
        return panel

    def _toggle(self, name: str, shown: bool) -> None:
        self._layers[name] = shown
        self.show(self._index)

    def _tick(self) -> bool:
        """Show the next moment while playing; called before each picture, returns whether to draw one."""
        if self._unseen:  # pictures drawn before the window is on the screen may never get there
            self._unseen -= 1
            self._window.post_redraw()
        now = time.monotonic()
        if not self._play.is_on or now - self._played_at < _PLAYED_S:
            return False
        self._played_at = now
        self.show((self._index + 1) % len(self._run.moments))
        return True

    def _layout(self, context) -> None:
        area = self._window.content_rect
        height = self._panel.calc_preferred_size(context, self._gui.Widget.Constraints()).height
        self._scene.frame = self._gui.Rect(area.x, area.y, area.width, area.height - height)
        self._panel.frame = self._gui.Rect(area.x, area.get_bottom() - height, area.width, height)
