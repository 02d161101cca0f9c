"""Tactile code network: contact geometry to a code to compare with the codebook (paper section 4.2)."""

from .inference import TactileCodeNet, load_tcn

__all__ = ["TactileCodeNet", "load_tcn"]
