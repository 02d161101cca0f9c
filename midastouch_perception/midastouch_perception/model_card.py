"""The model card of a network: a JSON file beside it that says where it comes from and how to use it."""

from __future__ import annotations

import json
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path


def read_card(network: Path) -> dict:
    """The model card of a network's file. Raises InputError if it is missing or broken."""
    path = network.with_suffix(".json")
    try:
        card = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no readable model card beside the network; copy it there") from error
    if not isinstance(card, dict):
        raise InputError(f"{path}: not a model card; copy the network's own there")
    return card


def write_card(card: dict, network: Path) -> None:
    """Write the model card of a network's file."""
    with atomic_path(network.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps(card, indent=2) + "\n")
