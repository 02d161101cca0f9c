"""Tables of the checks on tactile images: false and missed alarms, of an `evaluate-checks` result or the newest one."""

from __future__ import annotations

import pandas as pd

from .reports import report
from .table import Row, listed, percent, text, tidy, written


def checks() -> pd.DataFrame:
    """Table of false and missed alarms."""
    content = report("checks")
    rows = [[what, one["alarms"]] for what, one in content["fit_check"].items()]
    rows[0][0] = "all as it should be (false alarms)"
    layouts = [[f"no-contact image {what}", refused] for what, refused in content["no_contact_image"].items()]
    layouts[0][0] = "no-contact image as it should be (false alarms)"
    rows += layouts
    for name, one in content["real_sensors"].items():
        trials = f"real presses `{name}`, {one['trials']} trials"
        rows.append([f"{trials}: as it should be (false alarms)", one["right"]])
        rows.append([f"{trials}: background taken in contact", one["touched"]])
    frame = pd.DataFrame(rows, columns=["what", "alarms"])
    return written(frame, {"what is given": text("what"), "alarms, [checks]": percent("alarms")}, {})


def diameters(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a wrong diameter of the ball is refused."""
    content = content or report("checks")
    about = {
        "diameter given, over the true one": text("factor", "{:.2g}"),
        "refused unless said to be right": percent("doubted"),
    }
    return written(tidy(content["ball_diameter"]["given"]), about, {})


def contacts(content: dict | None = None) -> pd.DataFrame:
    """Table of the presses that the contact decision misses."""
    content = content or report("checks")
    missed = {f"{what}; simulator's light": bins for what, bins in content["contact"]["missed"].items()}
    missed |= content["light_touches"]
    rows = [{"what": what} | one for what, bins in missed.items() for one in bins if one["touches"]]

    def pressed(row: Row) -> str:
        return f"{row['from_mm']:g} to {row['to_mm']:g} mm"

    about = {
        "object; sensor": text("what"),
        "pressed": pressed,
        "touches": text("touches"),
        "missed": percent("missed"),
    }
    return written(tidy(rows), about, {})


def brightness(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a change of light is taken for a contact."""
    content = content or report("checks")

    def light(row: Row) -> str:
        return f"{100 * row['brighter']:.0f} % brighter"

    about = {"no contact, and the light": light, "taken for contact": percent("false_contacts")}
    return written(tidy(content["contact"]["false"]), about, {})


def gels(content: dict | None = None) -> pd.DataFrame:
    """Table of how reliably a gel is recognised by its texture."""
    content = content or report("checks")
    about = {"texture of real gels": text("what"), "trials": text("trials"), "said": percent("said")}
    return written(tidy({"what": what} | one for what, one in content["gels"].items()), about, {})


def slow_light(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a slow change of the light is taken for a contact."""
    content = content or report("checks")

    def light(row: Row) -> str:
        return f"up to {100 * row['change']:.0f} %"

    about = {
        "sensor": text("sensor"),
        "light that changes unevenly": light,
        "within so many images": text("images"),
        "frames": text("frames"),
    }
    return written(tidy(content["slow_light"]), about | {"taken for contact": percent("false_contacts")}, {})


def check_tables(content: dict) -> list[pd.DataFrame]:
    """Return the tables of an `evaluate-checks` result."""
    fit = {
        "fit check, simulated sensors": text("what"),
        "alarms": percent("alarms"),
        "named turned": percent("named_turned"),
        "quietest tenth": text("quietest_tenth", "{:.2f}"),
        "ROC area": text("auc_quietest_tenth", "{:.2f}"),
        "explained": text("explained_share", "{:.2f}"),
        "ROC area ": text("auc_explained_share", "{:.2f}"),
    }
    real_sensors = {
        "real sensor, alarms if the no-contact image is": text("what"),
        "trials": text("trials"),
        "right": percent("right"),
        "touched": percent("touched"),
    }
    refused = {"no-contact image, real, each against the others": text("what"), "refused": percent("refused")}
    causes = [
        {"what": what, "refused": one, "named": content["cause_named"].get(what)}
        for what, one in content["no_contact_image"].items()
    ]
    slowly = content["contact"]["false_while_warming"]
    light = brightness(content)
    light.loc[len(light)] = ["getting 10 % brighter, slowly", f"{100 * slowly:.0f} %"]
    return [
        written(tidy({"what": what} | one for what, one in content["fit_check"].items()), fit, {}),
        written(tidy({"what": what} | one for what, one in content["real_sensors"].items()), real_sensors, {}),
        diameters(content),
        written(tidy(causes), refused | {"cause named": percent("named")}, {}),
        listed(("capture of a background", "cases"), ((k, f"{100 * v:.0f} %") for k, v in content["capture"].items())),
        contacts(content),
        light,
        slow_light(content),
        gels(content),
    ]
