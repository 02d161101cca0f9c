"""Lets the tests of the replay share what the tests of bags record."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "bags"))
