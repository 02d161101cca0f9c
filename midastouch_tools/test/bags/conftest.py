"""Lets the tests of bags share what they record."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
