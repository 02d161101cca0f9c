"""Recorded slides: reading (YCB-Slide, simulated and real; TactileTracking) and writing."""

from .loading import load_sequence
from .sequence import Sequence
from .writer import write_sequence

__all__ = ["Sequence", "load_sequence", "write_sequence"]
