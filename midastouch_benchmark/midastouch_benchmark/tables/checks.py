"""Tables of the checks on tactile images: false and missed alarms, of `evaluate-perception checks` and `guards`."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from .reports import report
from .table import Row, Table, listed, percent, text


def _named(by_name: dict[str, dict]) -> Iterator[dict]:
    """Yield rows whose label is their name in a result."""
    return ({"what": what} | one for what, one in by_name.items())


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
    alarms = ({"what": what, "alarms": each} for what, each in rows)
    return Table({"what is given": text("what"), "alarms, [checks]": percent("alarms")}).of(alarms)


def diameters(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a wrong diameter of the ball is refused."""
    about = {
        "diameter given, over the true one": text("factor", "{:.2g}"),
        "refused unless said to be right": percent("doubted"),
    }
    return Table(about).of((content or report("checks"))["ball_diameter"]["given"])


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
    return Table(about).of(rows)


def brightness(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a change of light is taken for a contact."""

    def light(row: Row) -> str:
        return f"{100 * row['brighter']:.0f} % brighter"

    about = {"no contact, and the light": light, "taken for contact": percent("false_contacts")}
    return Table(about).of((content or report("checks"))["contact"]["false"])


def gels(content: dict | None = None) -> pd.DataFrame:
    """Table of how reliably a gel is recognised by its texture."""
    about = {"texture of real gels": text("what"), "trials": text("trials"), "said": percent("said")}
    return Table(about).of(_named((content or report("checks"))["gels"]))


def ramps(content: dict | None = None) -> pd.DataFrame:
    """Table of images of growing and shrinking presses that are not felt, and of readings that fall meanwhile."""

    def fall(row: Row) -> str:
        return f"{row['presses_falling']} ({abs(row['most_fall_mm']):.2f} mm)"

    about = {
        "sensor": text("sensor"),
        "pressed by 0.2 to 2.5 mm": text("shape"),
        "presses": text("presses"),
        "images": text("images"),
        "taken for free": text("missed"),
        "of presses": text("presses_missed"),
        "unknown": text("unknown"),
        "depth falls while they grow, in presses (at most)": fall,
        "free images": text("free_images"),
        "not free": text("false"),
    }
    return Table(about).of((content or report("ramps"))["ramps"])


def slow_light(content: dict | None = None) -> pd.DataFrame:
    """Table of how often a slow change of the light is taken for a contact."""
    about = {
        "sensor": text("sensor"),
        "light that changes unevenly": lambda row: f"up to {100 * row['change']:.0f} %",
        "within so many images": text("images"),
        "frames": text("frames"),
        "taken for contact": percent("false_contacts"),
    }
    return Table(about).of((content or report("checks"))["slow_light"])


def guards(content: dict) -> pd.DataFrame:
    """Table of the frames that the guards refuse, of an `evaluate-perception guards` result."""

    def refused(row: Row) -> str:
        low, high = row["interval"]
        return f"{100 * row['share']:.2f} % ({100 * low:.2f} %...{100 * high:.2f} %)"

    about = {
        "sensor": text("sensor"),
        "frames": text("what"),
        "slides": text("slides"),
        "shown": text("frames"),
        "refused": refused,
    }
    return Table(about).of(content["guards"])


_FIT = Table(
    {
        "fit check, simulated sensors": text("what"),
        "alarms": percent("alarms"),
        "named turned": percent("named_turned"),
        "quietest tenth": text("quietest_tenth", "{:.2f}"),
        "ROC area": text("auc_quietest_tenth", "{:.2f}"),
        "explained": text("explained_share", "{:.2f}"),
        "ROC area ": text("auc_explained_share", "{:.2f}"),
    }
)
_REAL_SENSORS = Table(
    {
        "real sensor, alarms if the no-contact image is": text("what"),
        "trials": text("trials"),
        "right": percent("right"),
        "touched": percent("touched"),
    }
)
_REFUSED = Table(
    {
        "no-contact image, real, each against the others": text("what"),
        "refused": percent("refused"),
        "cause named": percent("named"),
    }
)


def check_tables(content: dict) -> list[pd.DataFrame]:
    """Return the tables of an `evaluate-perception checks` result."""
    refused = [
        {"what": what, "refused": one, "named": content["cause_named"].get(what)}
        for what, one in content["no_contact_image"].items()
    ]
    light = brightness(content)
    light.loc[len(light)] = [
        "getting 10 % brighter, slowly",
        f"{100 * content['contact']['false_while_warming']:.0f} %",
    ]
    captures = ((name, f"{100 * each:.0f} %") for name, each in content["capture"].items())
    return [
        _FIT.of(_named(content["fit_check"])),
        _REAL_SENSORS.of(_named(content["real_sensors"])),
        diameters(content),
        _REFUSED.of(refused),
        listed(("capture of a background", "cases"), captures),
        contacts(content),
        light,
        slow_light(content),
        gels(content),
    ]
