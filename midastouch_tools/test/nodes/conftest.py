"""The stand-ins beside this file and beside the filter node's tests can be imported."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[3] / "midastouch_filter/test/nodes"))
