"""The world and the flights beside these tests, which benchmarks take too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
