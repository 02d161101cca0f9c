"""Texts of the live view, as Markdown: progress of a calibration, the filter's state, which object it is."""

from __future__ import annotations

from collections.abc import Mapping

_TO_DO, _DONE = "\u25cb", "\u25cf"
_BAR = 10  # marks of a probability of 1


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
    if objects:
        lines.append("## object")
        lines += [f"{_marks(round(_BAR * p), _BAR)} {p:.0%} {name}" for name, p in objects.items()]
    return "\n\n".join(lines)


def _marks(done: int, all_of_them: int) -> str:
    return _DONE * done + _TO_DO * max(all_of_them - done, 0)
