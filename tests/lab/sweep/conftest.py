"""Functions that worker processes can import."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for `acts`; worker processes inherit the path
