"""Functions that worker processes find too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for `acts`; worker processes take it over
