"""Tactile code network: from contact geometry to a code that is compared with the codebook (paper section 4.2)."""

from .inference import AnyCodeNet, TactileCodeNet, load_tcn

__all__ = ["AnyCodeNet", "TactileCodeNet", "load_tcn"]
