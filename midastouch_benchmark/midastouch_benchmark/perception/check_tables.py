"""The tables of an `evaluate-checks` result, for the terminal and for the results page."""

from __future__ import annotations

from midastouch_bringup.text_table import number

_FIT = ("alarms", "named_turned", "quietest_tenth", "auc_quietest_tenth", "explained_share", "auc_explained_share")


def check_tables(result: dict) -> list[tuple[list[str], list[list[object]]]]:
    """Header and rows of each table."""
    fit = [[name, *(number(case[key], 2) for key in _FIT)] for name, case in result["fit_check"].items()]
    missed = [
        [f"{part}, {c['from_mm']:.2f} to {c['to_mm']:.2f} mm deep", c["touches"], number(c["missed"], 2)]
        for part, classes in result["contact"]["missed"].items()
        for c in classes
    ]
    false = [
        [f"{100 * c['brighter']:g} % brighter", number(c["false_contacts"], 2)] for c in result["contact"]["false"]
    ]
    false.append(["getting 10 % brighter, slowly", number(result["contact"]["false_while_warming"], 2)])
    header = ["fit check, simulated sensors", "alarms", "named turned", "quietest tenth", "ROC area"]
    header += ["explained share", "ROC area"]
    causes = [
        [name, number(share, 2), number(result["cause_named"].get(name), 2)]
        for name, share in result["no_contact_image"].items()
    ]
    real = [
        [name, one["trials"], number(one["right"], 2), number(one["touched"], 2)]
        for name, one in result["real_sensors"].items()
    ]
    diameters = [[f"{given['factor']:.2g}", number(given["doubted"], 2)] for given in result["ball_diameter"]["given"]]
    return [
        (header, fit),
        (["real sensor, alarms if the no-contact image is", "trials", "right", "touched"], real),
        (["diameter of a calibration's ball over the true one", "refused unless said to be right"], diameters),
        (["no-contact image, real, each against the others", "refused", "cause named"], causes),
        (["capture of a background", "share"], _shares(result["capture"])),
        (["light touches", "touches", "missed"], missed),
        (["no contact, brightness against the background", "false contacts"], false),
    ]


def _shares(shares: dict[str, float]) -> list[list[object]]:
    return [[name, number(share, 2)] for name, share in shares.items()]
