"""Stand-ins that can be imported."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
# The filter node's stand-ins are beside its own tests.
sys.path.insert(0, str(Path(__file__).parents[3] / "midastouch_filter/test/nodes"))
