"""Tactile depth network: from camera image to penetration map (paper section 4.1)."""

from .background import estimate_background
from .depth_net import DepthNet
from .inference import TactileDepthNet, load_tdn

__all__ = ["DepthNet", "TactileDepthNet", "estimate_background", "load_tdn"]
