"""Error rates of the checks on tactile images: fit check, no-contact image, contact decision.

They are measured on imaginary sensors of the training's randomisation over real no-contact images, and on those images
themselves, each judged against the mean of the others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.network_checks import diameter_doubt, measured_maps, measured_radius
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import DepthNet
from midastouch_perception.tdn.background import TouchedBackground, shows_contact
from midastouch_perception.tdn.colour_layout import (
    ORIENTATIONS,
    image_problem,
    mean_layout,
    misorientation,
    turned_since,
)
from midastouch_perception.tdn.fit_check import FitCheck
from midastouch_simulation.procedural import cylinder, mesh_from_sdf
from midastouch_simulation.randomisation import RandomisationRange, RandomSensor
from midastouch_simulation.simulated_digit import PressedSensor
from midastouch_tools.datasets.ball_presses import BallPresses

TOUCHES = 6
"""Touches of each imaginary sensor on the tool, and as many light ones on each small part."""
LIGHT_TOUCHES = ContactSampling(press=(0.05e-3, 0.6e-3), free_fraction=0.0)
_FIRM = ContactSampling(press=(0.5e-3, 1.5e-3), free_fraction=0.0)
DEPTHS = (0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3, 0.7e-3)
"""Edges [m] of the classes of true penetration in which missed contacts are counted."""
WARM_UP = (0.0, 0.01, 0.02, 0.05, 0.1)
"""Change of brightness against the no-contact image at which false contacts are counted."""
_WARM_UP_FRAMES = 60
"""Frames in which the light rises from the first of `WARM_UP` to the last: a tenth, faster than any sensor's."""


@dataclasses.dataclass(frozen=True)
class ImaginarySensor:
    """Images of an imaginary sensor. background: (H, W, 3) uint8, the stored no-contact image; touches: (N, H, W, 3)
    uint8, firm ones; light: by part, images (N, H, W, 3) uint8 of light touches and true deepest penetration (N,) m;
    free: (H, W, 3) uint8, a second no-contact image."""

    background: np.ndarray
    touches: np.ndarray
    light: dict[str, tuple[np.ndarray, np.ndarray]]
    free: np.ndarray


def wire() -> ObjectMesh:
    """Return a straight wire 2 mm thick and 40 mm long."""
    return mesh_from_sdf(cylinder(1e-3, 0.02, 2e-4), np.array([1.5e-3, 1.5e-3, 0.021]), 3e-4, "wire")


def imaginary_sensors(
    n: int, sensor: SensorModel, backgrounds: np.ndarray, ranges: RandomisationRange, rng: np.random.Generator
) -> Iterator[ImaginarySensor]:
    """Yield `n` sensors with optics of `ranges` over `backgrounds` (B, H, W, 3) uint8, each with its touches."""
    meshes = {name: ObjectMesh.load(bundled_objects()[name]) for name in ("handle_tool", "eyebolt")}
    meshes["wire"] = wire()
    renderers = {name: PenetrationRenderer(mesh, sensor) for name, mesh in meshes.items()}
    poses = {}
    for name, mesh in meshes.items():
        sampling = _FIRM if name == "handle_tool" else LIGHT_TOUCHES
        poses[name] = sample_contact_poses(mesh, n * TOUCHES, rng, sensor, sampling).reshape(n, TOUCHES, 4, 4)
    for i in range(n):
        drawn = RandomSensor(sensor, backgrounds, rng, ranges)
        images, depths = {}, {}
        for name, renderer in renderers.items():
            penetration, normals = renderer.render_with_normals(poses[name][i])
            images[name], background = drawn.images(penetration, normals, rng)
            depths[name] = penetration.max(axis=(1, 2))
        nothing = np.zeros((1, sensor.height, sensor.width), np.float32)
        free, _ = drawn.images(nothing, np.zeros((*nothing.shape, 3), np.float32), rng)
        light = {name: (as_bytes(images[name]), depths[name]) for name in ("eyebolt", "wire")}
        yield ImaginarySensor(as_bytes(background), as_bytes(images["handle_tool"]), light, as_bytes(free[0]))


def as_bytes(image: np.ndarray) -> np.ndarray:
    """Return grey levels as uint8."""
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


_swapped, _turned = ORIENTATIONS["with red and blue swapped"], ORIENTATIONS["upside down"]

FAULTS: dict[str, Callable[[ImaginarySensor, ImaginarySensor], tuple[np.ndarray, np.ndarray]]] = {
    "images swap red and blue": lambda own, other: (_swapped(own.touches), own.background),
    "images and background swap red and blue": lambda own, other: (_swapped(own.touches), _swapped(own.background)),
    "images upside down": lambda own, other: (own.touches[:, ::-1, ::-1], own.background),
    "images and background upside down": lambda own, other: (own.touches[:, ::-1, ::-1], _turned(own.background)),
    "another sensor's background": lambda own, other: (own.touches, other.background),
    "15 % brighter than the background": lambda own, other: (as_bytes(own.touches * 1.15), own.background),
    "light saturated": lambda own, other: (as_bytes(own.touches * 2.5), as_bytes(own.background * 2.5)),
    "background taken in contact": lambda own, other: (own.touches[1:], own.touches[0]),
}
"""Faults by name: each makes images and background from those of a sensor and of another one."""


def check_quality(tdn: DepthNet, sensors: Iterable[tuple[ImaginarySensor, ImaginarySensor]]) -> dict[str, dict]:
    """Judge imaginary sensors with their own background, and with each of `FAULTS`, which may use the second sensor's.

    Returns fit_check: as `_fit_figures`; contact: the fraction of light touches missed, by part and true depth, and of
    false contacts by brightness; capture: by case, the fraction of offered no-contact images refused as touched.
    """
    scores: dict[str, list[tuple[float, float, bool, bool]]] = {}
    light: dict[str, list[tuple[float, bool]]] = {}
    free: dict[float, list[bool]] = {gain: [] for gain in WARM_UP}
    warming: list[bool] = []
    captures: dict[str, list[bool]] = {}

    def in_contact(image: np.ndarray, background: np.ndarray) -> bool:
        return DepthStage(tdn).process(image, background).in_contact

    for own, other in sensors:
        for name, make in {"right": lambda own, other: (own.touches, own.background), **FAULTS}.items():
            scores.setdefault(name, []).append(_fit_scores(tdn, *map(np.ascontiguousarray, make(own, other))))
        for name, (images, depths) in own.light.items():
            seen = [in_contact(image, own.background) for image in images]
            light.setdefault(name, []).extend(zip(depths.tolist(), seen, strict=True))
        for gain, contacts in free.items():
            contacts.append(in_contact(as_bytes(own.free * (1 + gain)), own.background))
        stage = DepthStage(tdn)
        for gain in np.linspace(WARM_UP[0], WARM_UP[-1], _WARM_UP_FRAMES):
            warming.append(stage.process(as_bytes(own.free * (1 + gain)), own.background).in_contact)
        for name, candidate, present in (
            ("a touch refused", own.touches[0], own.background),
            ("no contact refused", own.free, own.background),
            ("no contact after a background in contact refused", own.free, own.touches[0]),
            ("another sensor's no contact refused", other.background, own.background),
        ):
            captures.setdefault(name, []).append(shows_contact(tdn, candidate, present))
    return {
        "fit_check": _fit_figures(scores),
        "contact": {
            "missed": {name: missed_by_depth(touches) for name, touches in light.items()},
            "false": [{"brighter": gain, "false_contacts": float(np.mean(some))} for gain, some in free.items()],
            "false_while_warming": float(np.mean(warming)),
        },
        "capture": {name: float(np.mean(refused)) for name, refused in captures.items()},
    }


def _fit_scores(tdn: DepthNet, images: np.ndarray, background: np.ndarray) -> tuple[float, float, bool, bool]:
    """Return both figures of the fit check, whether there is an alarm, and whether it names a turn or swap."""
    check, touched = judge(tdn, images, background)
    quiet, explained = (np.nan if value is None else value for value in (check.quiet, check.explained))
    turned = bool(check.problem) and bool(turned_since(images[-1], background))
    return quiet, explained, bool(check.problem or touched.problem), turned


def _fit_figures(scores: dict[str, list[tuple[float, float, bool, bool]]]) -> dict[str, dict]:
    """Return by case: alarms and those that name a turn or swap (fractions of sensors), the median of each figure, and
    the area under its ROC curve against the right ones."""
    columns = {name: np.array(each, float).T for name, each in scores.items()}
    right_quiet, right_explained, *_ = columns["right"]
    return {
        name: {
            "alarms": float(np.mean(alarms)),
            "named_turned": float(np.mean(turned)),
            "quietest_tenth": float(np.nanmedian(quiet)),
            "explained_share": float(np.nanmedian(explained)),
            "auc_quietest_tenth": roc_area(quiet, right_quiet),
            "auc_explained_share": roc_area(right_explained, explained),
        }
        for name, (quiet, explained, alarms, turned) in columns.items()
    }


def judge(tdn: DepthNet, images: Collection[np.ndarray], background: np.ndarray) -> tuple[FitCheck, TouchedBackground]:
    """Return both checks after they saw the images (320, 240, 3) uint8 of a sensor with this no-contact image."""
    check = FitCheck(tdn.sensor, every=1, window=len(images))
    touched = TouchedBackground(tdn, every=1, window=len(images))
    stage = DepthStage(tdn, check, touched)
    for image in images:
        stage.process(image, background)
        stage.deferred_update()
    return check, touched


def roc_area(high: np.ndarray, low: np.ndarray) -> float:
    """Return the chance that one of `high` lies above one of `low`, ties counting half: the area under the ROC."""
    high, low = high[np.isfinite(high)][:, None], low[np.isfinite(low)][None]
    return float(np.mean((high > low) + 0.5 * (high == low))) if high.size and low.size else float("nan")


def layout_quality(backgrounds: np.ndarray) -> tuple[dict[str, float], dict[str, float]]:
    """Return the fraction of real no-contact images (B, H, W, 3) uint8 refused, unchanged and made wrong in each way;
    and of those turned in each way, the fraction whose turn is named.

    Each is compared with the mean of the others.
    """
    wrong: dict[str, Callable] = {"right": lambda image: image, **ORIENTATIONS, "black": np.zeros_like}
    wrong["saturated"] = lambda image: as_bytes(image * 2.5)
    refused: dict[str, list[bool]] = {name: [] for name in wrong}
    named: dict[str, list[bool]] = {name: [] for name in ORIENTATIONS}
    for i, image in enumerate(backgrounds):
        layout = mean_layout(np.delete(backgrounds, i, axis=0))
        for name, make in wrong.items():
            made = np.ascontiguousarray(make(image))
            refused[name].append(bool(image_problem(made, layout)))
            if name in named:
                named[name].append(misorientation(made, layout) == name)
    alarms, causes = ({name: float(np.mean(each)) for name, each in some.items()} for some in (refused, named))
    return alarms, causes


def missed_by_depth(touches: Sequence[tuple[float, bool]]) -> list[dict]:
    """Return the number of touches and the fraction missed in each class of `DEPTHS`; touches: true deepest penetration
    [m] of each, and whether it is seen as a contact."""
    depth, in_contact = np.array(touches, float).T
    classes = np.digitize(depth, DEPTHS)
    return [
        {
            "from_mm": 1e3 * DEPTHS[k - 1],
            "to_mm": 1e3 * DEPTHS[k],
            "touches": int((classes == k).sum()),
            "missed": float(1 - in_contact[classes == k].mean()) if (classes == k).any() else None,
        }
        for k in range(1, len(DEPTHS))
    ]


_DRAWS = 2


def real_checks(tdn: DepthNet, presses: BallPresses, rng: np.random.Generator) -> dict[str, float]:
    """Return the fraction of alarms when the no-contact image is right, and when it shows one of the presses.

    Every press is the no-contact image twice, each time for `TOUCHES` others that are drawn; the same others are judged
    with the right image. Result: trials of each kind, alarms by kind.
    """
    names = list(presses.images)
    alarms: dict[str, list[bool]] = {"right": [], "touched": []}
    for name in np.repeat(names, _DRAWS):
        others = rng.choice([other for other in names if other != name], TOUCHES, replace=False)
        images = [presses.images[other] for other in others]
        for kind, background in (("right", presses.background), ("touched", presses.images[name])):
            check, touched = judge(tdn, images, background)
            alarms[kind].append(bool(check.problem or touched.problem))
    return {"trials": len(names) * _DRAWS, **{kind: float(np.mean(given)) for kind, given in alarms.items()}}


FACTORS = (0.5, 1 / 1.4, 1.0, 1.4, 2.0)
"""Diameter given over the true one."""
RADII = 2e-3, 5e-3
"""Smallest and largest radius of the balls [m]."""
_PRESSES = 8


def diameter_checks(sensor: SensorModel, backgrounds: np.ndarray, n: int, rng: np.random.Generator) -> dict:
    """Return the quality of the check of ball diameters on `n` sensors with `backgrounds` (B, H, W, 3) uint8 RGB, full
    size: median of measured over true radius, standard deviation of its logarithm; by factor, fraction of diameters in
    doubt, which are refused unless you confirm them."""
    ratios = []
    outcomes: dict[float, list[bool]] = {factor: [] for factor in FACTORS}
    for radius, measured in measured_balls(sensor, backgrounds, n, rng):
        if measured is not None:
            ratios.append(measured / radius)
        for factor, seen in outcomes.items():
            seen.append(bool(diameter_doubt(measured, 2 * radius * factor, sensor)))
    return {
        "sensors": n,
        "felt_over_true": float(np.median(ratios)),
        "spread": float(np.std(np.log(ratios))),
        "given": [{"factor": factor, "doubted": float(np.mean(seen))} for factor, seen in outcomes.items()],
    }


def measured_balls(
    sensor: SensorModel, backgrounds: np.ndarray, n: int, rng: np.random.Generator
) -> Iterator[tuple[float, float | None]]:
    """Yield the radius [m] of the ball on each of `n` sensors, and the measured one, None if nothing is measured."""
    for _ in range(n):
        radius = rng.uniform(*RADII)
        digit = PressedSensor(sensor, backgrounds, radius, rng)
        maps = measured_maps(list(digit.presses(_PRESSES).values()), digit.background, sensor)
        yield radius, measured_radius(maps, sensor.for_maps.pixel_size)
