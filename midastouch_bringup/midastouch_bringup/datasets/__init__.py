"""YCB-Slide sequences: reading (simulated and real layout) and writing."""

from .sequence import Sequence
from .writer import write_sequence
from .ycb_slide import load_sequence

__all__ = ["Sequence", "load_sequence", "write_sequence"]
