"""Tables of the networks, the calibration and the checks of a sensor."""

from __future__ import annotations

from ..statistics.intervals import error_ratio
from .cells import final_error, percent, share_cell
from .reports import ENOUGH, OPTICS, UNMEASURED, Table, benchmark_summary, report, reported

_WANTED = {
    "not calibrated": ((0.7, 1.4), 0.6, (3.3, 6.0), 0.75, 0.3),
    "calibrated": ((0.9, 1.1), 0.9, (4.0, 4.8), 0.92, 0.13),
}
"""Of presses: deepest over deepest, correlation at least, radius felt [mm], IoU at least, RMSE inside [mm] at most."""


_PRESSES = "presses_d20641", "presses_d20641_calibrated", "presses_vocdex", "presses_vocdex_calibrated"


def real() -> Table:
    """Ten objects through the optics of measured sensors, against TACTO's on the same slides."""
    header = ["optics", "particles, mean", "closest mode, median", "right", "mean error over TACTO's"]
    header += ["median of pairs", "report"]
    rows = []
    for name, what in OPTICS.items():
        if name not in reported():
            rows.append([what, *[UNMEASURED] * 5, "-"])
            continue
        one = benchmark_summary(name)
        cells = [f"too few ({one['trials']})"] * 5
        if one["trials"] >= ENOUGH:
            ratio = error_ratio(report(name)["trials"], report("real_plain")["trials"])
            cells = [
                final_error(one, "e", "mean"),
                final_error(one, "closest_mode", "median"),
                share_cell(one["trust"]["right_at_end"]),
                f"{ratio.value:.2f} ({ratio.low:.2f}...{ratio.high:.2f})",
                f"{ratio.median:.2f}",
            ]
        rows.append([what, *cells, f"[{name}]"])
    return header, rows


def depth_summary(name: str) -> dict:
    return report(name)["summary"]


def depth() -> Table:
    """The depth network where the truth is known."""
    labels = {
        "evaluate_tdn": "three slides of another renderer",
        "evaluate_tdn_held_out": "our slides over seven scans that only validate",
    }
    rows = [
        [
            label,
            f"{depth_summary(name)['rmse_mm']:.3f} mm",
            f"{depth_summary(name)['contact_rmse_mm']:.3f} mm",
            f"{depth_summary(name)['contact_iou']:.3f}",
            f"[{name}]",
        ]
        for name, label in labels.items()
    ]
    rows.append(["*paper*", "0.135 mm", "-", "-", "-"])
    return ["slides", "RMSE, all pixels", "in contact", "contact IoU", "report"], rows


def labels() -> Table:
    """The same presses without the labels, and the labels themselves."""
    rows = []
    for sensor in ("d20641", "vocdex"):
        plain, calibrated = (report(f"presses_{sensor}{how}") for how in ("", "_calibrated"))
        for what, content, key in (
            ("labels against images", plain, "labels"),
            ("felt without calibration, against images", plain, "against_fit"),
            ("felt with calibration, against images", calibrated, "against_fit"),
        ):
            cells = [UNMEASURED] * 4
            if one := content.get(key):
                cells = [f"{one['rmse_in_circle_mm']:.2f} mm", f"{one['peak_ratio']:.2f}"]
                cells += [f"{one['depth_correlation']:.2f}", f"{one['centre_mm']:.2f} mm"]
            rows.append([f"{1e3 * plain['ball_diameter']:.1f} mm", what, *cells])
    return ["ball", "what", "RMSE inside", "deepest over deepest", "correlation of both", "centres apart"], rows


def presses() -> Table:
    """The depth network on two real sensors, against the ball under the labelled outline."""
    rows = []
    for name in _PRESSES:
        content = report(name)
        one = content["summary"]
        rows.append(
            [
                f"{1e3 * content['ball_diameter']:.1f} mm, {one['presses']} times",
                f"with {content['calibrated_with']} others" if content["calibrated_with"] else "without",
                f"{one['rmse_in_circle_mm']:.2f} mm",
                f"{one['peak_ratio']:.2f}",
                f"{one['depth_correlation']:.2f}",
                f"{one['felt_radius_mm']:.1f} mm",
                f"{one['iou']:.2f}",
                f"{one['brightness_mm']:.3f} mm",
                f"[{name}]",
            ]
        )
    header = ["ball", "calibration", "RMSE inside", "deepest felt over deepest of the ball", "correlation of both"]
    return [*header, "radius felt", "IoU", "by 10 % of light", "report"], rows


def wanted() -> Table:
    """What a real sensor is to be read with, and what is missed."""
    rows = []
    for name, ball in (("d20641", "8.8 mm"), ("vocdex", "6.0 mm")):
        for how, (peak, correlation, radius, iou, rmse) in _WANTED.items():
            one = report(f"presses_{name}{'_calibrated' if how == 'calibrated' else ''}")["summary"]
            rows.append(_wanted_row(f"{ball}, {how}: deepest over deepest", one["peak_ratio"], 2, *peak))
            if name == "vocdex":  # of the others nothing was said for this sensor
                continue
            rows += [
                _wanted_row(f"{ball}, {how}: correlation", one["depth_correlation"], 2, correlation, None),
                _wanted_row(f"{ball}, {how}: radius felt, mm", one["felt_radius_mm"], 1, *radius),
                _wanted_row(f"{ball}, {how}: IoU", one["iou"], 2, iou, None),
                _wanted_row(f"{ball}, {how}: RMSE inside, mm", one["rmse_in_circle_mm"], 2, None, rmse),
            ]
    unsteady = max(report(name)["summary"]["brightness_mm"] for name in _PRESSES)
    rows.append(_wanted_row("the most by 10 % of light, mm", unsteady, 3, None, 0.01))
    tacto = depth_summary("evaluate_tdn")
    rows.append(_wanted_row("slides of another renderer: RMSE, mm", tacto["rmse_mm"], 3, None, 0.059))
    rows.append(_wanted_row("slides of another renderer: IoU", tacto["contact_iou"], 3, 0.963, None))
    for name, how, most in (("real_sensor", "", 2.0), ("real_sensor_calibrated", " calibrated", 1.2)):
        ratio = error_ratio(report(name)["trials"], report("real_plain")["trials"]).value
        rows.append(_wanted_row(f"slides: error through{how} real sensors, over TACTO's", ratio, 2, None, most))
    for name, light, most in (("single_touch", "TACTO's light", 0.30), ("single_touch_random", "random sensors", 0.38)):
        error = report(name)["summary"]["normalised_top25_error"]
        rows.append(_wanted_row(f"one touch, {light}: mean error", error, 3, None, most))
    return ["what", "wanted", "measured", "missed"], rows


def _wanted_row(what: str, value: float, digits: int, least: float | None, most: float | None) -> list[str]:
    """Judged as printed."""
    value = round(value, digits)
    bounds = [("at least", least), ("at most", most)]
    said = " and ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)
    met = (least is None or value >= least) and (most is None or value <= most)
    return [what, said, f"{value:.{digits}f}", "" if met else "missed"]


def checks() -> Table:
    """False and missed alarms."""
    content = report("checks")
    rows = [[what, percent(one["alarms"])] for what, one in content["fit_check"].items()]
    rows[0][0] = "all as it should be (false alarms)"
    layouts = [[f"no-contact image {what}", percent(share)] for what, share in content["no_contact_image"].items()]
    layouts[0][0] = "no-contact image as it should be (false alarms)"
    rows += layouts
    for name, one in content["real_sensors"].items():
        trials = f"real presses `{name}`, {one['trials']} trials"
        rows.append([f"{trials}: as it should be (false alarms)", percent(one["right"])])
        rows.append([f"{trials}: background taken in contact", percent(one["touched"])])
    return ["what is given", "alarms, [checks]"], rows


def diameters() -> Table:
    """What becomes of a wrong diameter of the ball."""
    rows = [[f"{one['factor']:.2g}", percent(one["doubted"])] for one in report("checks")["ball_diameter"]["given"]]
    return ["diameter given, over the true one", "refused unless said to be right"], rows


def contacts() -> Table:
    """Presses that the contact decision misses."""
    rows = []
    for what, bins in report("checks")["contact"]["missed"].items():
        rows += [
            [what, f"{one['from_mm']:g} to {one['to_mm']:g} mm", one["touches"], percent(one["missed"])]
            for one in bins
            if one["touches"]
        ]
    return ["object", "pressed", "touches", "missed"], rows


def brightness() -> Table:
    """What the contact decision makes of a change of light."""
    rows = [
        [f"{percent(one['brighter'])} brighter", percent(one["false_contacts"])]
        for one in report("checks")["contact"]["false"]
    ]
    return ["no contact, and the light", "taken for contact"], rows


def single_touch() -> Table:
    """How far one touch tells where it is."""
    rows = []
    for name, light in (("single_touch", "TACTO's"), ("single_touch_random", "of random sensors")):
        one = report(name)["summary"]
        keys = ("normalised_top25_error", "median_of_medians", "normalised_by_single_random")
        rows.append([light, *(f"{one[key]:.3f}" for key in keys), f"[{name}]"])
    rows.append(["*paper; its image embedding*", "0.473; 0.546", "-", "-", "-"])
    return ["light", "mean", "median of medians", "against one random entry", "report"], rows
