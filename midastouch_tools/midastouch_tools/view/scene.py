"""A run in the object's frame, drawn by Rerun: live, or moment by moment when it is finished."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from midastouch_perception.sensor_calibration.collector import REGIONS

from ..datasets.sequence import IMAGE_SHAPE
from . import require_rerun
from .appearance import Trail, ellipsoids, scale_bar, weight_colours
from .words import guidance_text, status_text


def region_box(region: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the corner with the lowest coordinates and the size [px], x first, of one of `REGIONS` in the image."""
    row, column = divmod(REGIONS.index(region), 3)
    width, height = IMAGE_SHAPE[1] / 3, IMAGE_SHAPE[0] / 3
    return (column * width, row * height), (width, height)


_MOST_PARTICLES = 10_000
_MOST_LABELS = 4
_AXIS = 0.01  # m
_ESTIMATE, _TRUTH, _CONTACT = (40, 200, 80), (60, 150, 255), (255, 80, 200)
_MODE, _SCALE = (240, 160, 30), (128, 128, 128)
_LEGEND = f"""
- points, dark blue over red to yellow: particles, from light to heavy
- green: the published pose and its path; its ellipsoid holds two standard deviations
- orange ellipsoids: other poses that are possible, with their probability
- red, green and blue arrows: x, y and z of the gel, {1e3 * _AXIS:.0f} mm long
- pink: the contact that is measured, at the published pose
- blue: the true pose and its path, where a recording has it
- grey line: the scale
"""


class Scene:
    """Scene on a `rerun.RecordingStream`. Lengths are metres, poses (4, 4) are of the gel in the object's frame."""

    def __init__(self, recording) -> None:
        self._rr, self._recording = require_rerun(), recording
        self._trails: dict[str, Trail] = defaultdict(Trail)
        self._guiding = False
        self._state = "", ""
        self._objects: Mapping[str, float] = {}
        recording.send_blueprint(self._blueprint())
        recording.log("legend", self._rr.TextDocument(_LEGEND, media_type="text/markdown"), static=True)

    def mesh(self, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> None:
        """Show another object: vertices (V, 3), faces (F, 3), vertex normals (V, 3); clear drawings of the last one."""
        self._clear()
        ends, label = scale_bar(vertices)
        bar = self._rr.LineStrips3D([ends], colors=_SCALE, radii=0.0005, labels=[label], show_labels=True)
        self._recording.log("object/scale", bar, static=True)
        self._recording.log(
            "object/mesh",
            self._rr.Mesh3D(
                vertex_positions=vertices,
                triangle_indices=faces,
                vertex_normals=normals,
                albedo_factor=[190, 190, 200, 130],
            ),
            static=True,
        )

    def restart(self) -> None:
        """Remove everything but the mesh: the filter has started again."""
        self.objects({})
        self._clear()

    def _clear(self) -> None:
        for trail in self._trails.values():
            trail.clear()
        for name in ("particles", "modes", "axes", "gel", *self._trails):
            self._log(name, self._rr.Clear(recursive=True))

    def image(self, pixels: np.ndarray) -> None:
        """Show the tactile image (H, W, 3) uint8 RGB."""
        self._recording.log("image", self._rr.Image(pixels).compress(jpeg_quality=85))

    def particles(self, positions: np.ndarray, weights: np.ndarray) -> None:
        """Draw particles (N, 3) coloured by weight (N,), evenly thinned to at most 10000."""
        step = -(-len(positions) // _MOST_PARTICLES) or 1
        points = self._rr.Points3D(positions[::step], colors=weight_colours(weights)[::step], radii=0.0005)
        self._log("particles", points)

    def modes(self, weights: Sequence[float], poses: np.ndarray, covariances: np.ndarray) -> None:
        """Draw modes, heaviest first: poses (M, 4, 4), covariances (M, 6, 6), as two-sigma ellipsoids and gel axes."""
        half, quaternions = ellipsoids(covariances[:, :3, :3])
        colours = [(*(_ESTIMATE if i == 0 else _MODE), 60 + round(140 * w)) for i, w in enumerate(weights)]
        self._log(
            "modes",
            self._rr.Ellipsoids3D(
                centers=poses[:, :3, 3],
                half_sizes=half,
                quaternions=quaternions,
                colors=colours,
                labels=[f"{w:.0%}" for w in weights],
                show_labels=len(weights) <= _MOST_LABELS,
                fill_mode="solid",
            ),
        )
        vectors = _AXIS * np.swapaxes(poses[:, :3, :3], 1, 2).reshape(-1, 3)
        origins = np.repeat(poses[:, :3, 3], 3, axis=0)
        axes = [(230, 50, 50), (50, 200, 50), (50, 100, 240)] * len(poses)
        self._log("axes", self._rr.Arrows3D(origins=origins, vectors=vectors, colors=axes, radii=0.0004))

    def estimate(self, pose: np.ndarray, trial: str = "") -> None:
        """Draw the published pose (4, 4) `T_obj_gel`, of one trial if there are several."""
        self._log("gel", self._rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        self._trail(f"estimate{trial}", pose, _ESTIMATE)

    def truth(self, pose: np.ndarray) -> None:
        """Draw the true pose (4, 4) `T_obj_gel`, which some recordings have."""
        self._trail("truth", pose, _TRUTH)

    def contact(self, points: np.ndarray) -> None:
        """Draw contact points (K, 3), given in the gel frame, at the estimate."""
        self._log("gel/contact", self._rr.Points3D(points, colors=_CONTACT, radii=0.0002))

    def status(self, state: str, reason: str, numbers: Mapping[str, float]) -> None:
        """Show the state in words, and numbers as curves."""
        self._state = state, reason
        self._say()
        for name, value in numbers.items():
            self._recording.log(f"filter/{name}", self._rr.Scalars(float(value)))

    def objects(self, probabilities: Mapping[str, float]) -> None:
        """Show the probability of each candidate object by name; empty if the object was given."""
        self._objects = probabilities
        self._say()

    def guidance(self, step: str, values: Mapping[str, str]) -> None:
        """Show the next step of a calibration, and its progress; values: of the node `calibrate`."""
        if not self._guiding:
            self._guiding = True
            self._recording.send_blueprint(self._calibration_blueprint())
        text = guidance_text(step, values)
        self._recording.log("calibration", self._rr.TextDocument(text, media_type="text/markdown"))
        if (region := values.get("region")) in REGIONS:
            low, size = region_box(region)
            box = self._rr.Boxes2D(mins=[low], sizes=[size], labels=["press here"], colors=[_ESTIMATE])
        else:
            box = self._rr.Clear(recursive=True)
        self._recording.log("image/next", box)

    def _say(self) -> None:
        text = status_text(*self._state, self._objects)
        self._recording.log("status", self._rr.TextDocument(text, media_type="text/markdown"))

    def _trail(self, name: str, pose: np.ndarray, colour: tuple[int, int, int]) -> None:
        trail = self._trails[name]
        trail.add(pose[:3, 3])
        self._log(f"{name}/trail", self._rr.LineStrips3D(trail.strips, colors=colour, radii=0.0003))
        self._log(f"{name}/here", self._rr.Points3D([pose[:3, 3]], colors=colour, radii=0.0015))

    def _log(self, name: str, content) -> None:
        self._recording.log(f"object/{name}", content)

    def _calibration_blueprint(self):
        from rerun import blueprint

        return blueprint.Blueprint(
            blueprint.Horizontal(
                blueprint.Spatial2DView(origin="image", name="tactile image"),
                blueprint.TextDocumentView(origin="calibration", name="calibration"),
            ),
            collapse_panels=True,
        )

    def _blueprint(self):
        from rerun import blueprint

        return blueprint.Blueprint(
            blueprint.Horizontal(
                blueprint.Spatial3DView(origin="object", name="object"),
                blueprint.Vertical(
                    blueprint.Spatial2DView(origin="image", name="tactile image"),
                    blueprint.TextDocumentView(origin="status", name="state"),
                    blueprint.Tabs(
                        blueprint.TextDocumentView(origin="legend", name="legend"),
                        blueprint.TimeSeriesView(origin="filter/particles", name="particles [count]"),
                        blueprint.TimeSeriesView(origin="filter/ms", name="time of a step [ms]"),
                        blueprint.TimeSeriesView(origin="filter/mass", name="mass of the best mode [0 to 1]"),
                    ),
                ),
                column_shares=[3, 1],
            ),
            collapse_panels=True,
        )
