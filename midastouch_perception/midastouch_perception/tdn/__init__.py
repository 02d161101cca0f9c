"""Tactile depth network: camera image to penetration map (paper section 4.1)."""

from .background import estimate_background
from .inference import TactileDepthNet, load_tdn

__all__ = ["TactileDepthNet", "estimate_background", "load_tdn"]
