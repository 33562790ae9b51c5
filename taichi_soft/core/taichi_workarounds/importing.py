"""Import Taichi without its printed header, its request to a server for the newest version, and a warning.

This file is unnecessary once `import taichi` prints nothing and sends no request. The main branch does both.
"""

import os
import warnings

os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

with warnings.catch_warnings():
    warnings.simplefilter("ignore", SyntaxWarning)  # caused by a docstring of Taichi, from Python 3.12 on
    import taichi as ti

__all__ = ["ti"]
