"""Flights beside these tests, which a benchmark takes too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
