"""A run in the object's frame, drawn by Rerun: live, or moment by moment when it is finished."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from midastouch_filter.core.state import SEARCHING
from midastouch_perception.sensor_calibration.collector import REGIONS

from ..datasets.sequence import IMAGE_SHAPE
from . import require_rerun
from .appearance import Trail, ellipsoids, scale_bar, weight_colours


def region_box(region: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the corner with the lowest coordinates and the size [px], x first, of one of `REGIONS` in the image."""
    row, column = divmod(REGIONS.index(region), 3)
    width, height = IMAGE_SHAPE[1] / 3, IMAGE_SHAPE[0] / 3
    return (column * width, row * height), (width, height)


_MOST_PARTICLES = 10_000
_MOST_LABELS = 4
_AXIS = 0.01  # m
_LIFT = 0.002  # m along the gel's normal: a gel is pressed that deep into the object, which would hide what is drawn
_DISTANCE = 0.6  # of the eye along each short side, in diagonals of the object
_NO_OBJECT = 0.1 * np.array([[-1, -1, -1], [1, 1, 1]])  # m
_ESTIMATE, _TRUTH, _CONTACT = (40, 200, 80), (60, 150, 255), (255, 80, 200)
_TO_DO, _DONE = "\u25cb", "\u25cf"
_BAR = 10  # marks of a probability of 1
_MODE, _SCALE = (240, 160, 30), (128, 128, 128)
_LEGEND = f"""
- points, dark blue over red to yellow: particles, from light to heavy
- green: the published pose and its path; its ellipsoid holds two standard deviations
- orange ellipsoids: other poses that are possible, with their probability
- red, green and blue arrows: x, y and z of the gel, {1e3 * _AXIS:.0f} mm long
- pink: the contact that is measured, at the published pose
- blue: the true pose and its path, where a recording has it
- grey line: the scale
- all but object and scale is drawn {1e3 * _LIFT:.0f} mm off the object, which would hide it
"""


def _lifted(poses: np.ndarray) -> np.ndarray:
    """Return the origins (..., 3) of gel poses (..., 4, 4), lifted off the object."""
    return poses[..., :3, 3] + _LIFT * poses[..., :3, 2]


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
                vertex_positions=vertices, triangle_indices=faces, vertex_normals=normals, albedo_factor=[190, 190, 200]
            ),
            static=True,
        )
        if not self._guiding:
            self._recording.send_blueprint(self._blueprint(vertices))

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
        """Show the tactile image (H, W, 3) uint8 RGB; not as JPEG, which a busy browser decodes too late to show it."""
        self._recording.log("image", self._rr.Image(pixels))

    def particles(self, positions: np.ndarray, normals: np.ndarray, weights: np.ndarray) -> None:
        """Draw particles: positions, gel normals (N, 3), colours by weight (N,); evenly thinned to at most 10000."""
        step = -(-len(positions) // _MOST_PARTICLES) or 1
        lifted, colours = positions + _LIFT * normals, weight_colours(weights)
        points = self._rr.Points3D(lifted[::step], colors=colours[::step], radii=0.0005)
        self._log("particles", points)

    def modes(self, weights: Sequence[float], poses: np.ndarray, covariances: np.ndarray) -> None:
        """Draw modes, heaviest first: poses (M, 4, 4), covariances (M, 6, 6), as two-sigma ellipsoids and gel axes."""
        half, quaternions = ellipsoids(covariances[:, :3, :3])
        colours = [(*(_ESTIMATE if i == 0 else _MODE), 60 + round(140 * w)) for i, w in enumerate(weights)]
        self._log(
            "modes",
            self._rr.Ellipsoids3D(
                centers=_lifted(poses),
                half_sizes=half,
                quaternions=quaternions,
                colors=colours,
                labels=[f"{w:.0%}" for w in weights],
                show_labels=len(weights) <= _MOST_LABELS,
                fill_mode="solid",
            ),
        )
        vectors = _AXIS * np.swapaxes(poses[:, :3, :3], 1, 2).reshape(-1, 3)
        origins = np.repeat(_lifted(poses), 3, axis=0)
        axes = [(230, 50, 50), (50, 200, 50), (50, 100, 240)] * len(poses)
        self._log("axes", self._rr.Arrows3D(origins=origins, vectors=vectors, colors=axes, radii=0.0004))

    def estimate(self, pose: np.ndarray, trial: str = "") -> None:
        """Draw the published pose (4, 4) `T_obj_gel`, of one trial if there are several."""
        self._log("gel", self._rr.Transform3D(translation=_lifted(pose), mat3x3=pose[:3, :3]))
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
        trail.add(_lifted(pose))
        self._log(f"{name}/trail", self._rr.LineStrips3D(trail.strips, colors=colour, radii=0.0003))
        self._log(f"{name}/here", self._rr.Points3D([_lifted(pose)], colors=colour, radii=0.0015))

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

    def _blueprint(self, vertices: np.ndarray = _NO_OBJECT):
        from rerun import blueprint

        low, high = vertices.min(axis=0), vertices.max(axis=0)
        aside = np.where(np.arange(3) == np.argmax(high - low), 0.3, 1.0)  # the longest side lies across
        centre, distance = (low + high) / 2, _DISTANCE * np.linalg.norm(high - low)
        eye = blueprint.EyeControls3D(position=centre + distance * aside, look_target=centre, eye_up=[0, 0, 1])
        return blueprint.Blueprint(
            blueprint.Horizontal(
                blueprint.Spatial3DView(origin="object", name="object", line_grid=False, eye_controls=eye),
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


def guidance_text(step: str, values: Mapping[str, str]) -> str:
    """Return the next step, the progress, and the presses thrown away with the reasons.

    values: those of the node `calibrate` on `/diagnostics`.
    """
    lines = [f"# {step}", _marks(int(values.get("taken", 0)), int(values.get("wanted", 0)))]
    if values.get("last_press"):
        lines.append(f"Last press: {values['last_press']}")
    reasons = [reason for name, reason in values.items() if name.startswith("thrown_away_")]
    if reasons:
        lines.append(f"Thrown away: {values['thrown_away']}, the last ones:")
        lines.append("\n".join(f"- {reason}" for reason in reasons))
    return "\n\n".join(lines)


def status_text(state: str, reason: str, objects: Mapping[str, float]) -> str:
    """Return the state with its reason, and a bar for the probability of each object by name, if there are any."""
    lines = [f"# {state}", reason]
    if state == SEARCHING:
        lines.append("This is normal at first: keep touching, best over edges and corners.")
    if objects:
        lines.append("## object")
        lines += [f"{_marks(round(_BAR * p), _BAR)} {p:.0%} {name}" for name, p in objects.items()]
    return "\n\n".join(lines)


def _marks(done: int, all_of_them: int) -> str:
    return _DONE * done + _TO_DO * max(all_of_them - done, 0)
