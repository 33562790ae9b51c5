"""While a wheel is built: three.js comes in. Without a network `taichi-soft live` fetches it later."""

import runpy
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class FetchThreeJs(BuildHookInterface):
    """See `taichi_soft/live/three_js.py`."""

    def initialize(self, version, build_data):
        """Before files are collected."""
        try:
            runpy.run_path(str(Path(self.root) / "taichi_soft" / "live" / "three_js.py"))["fetch_three_js"]()
        except OSError as error:
            self.app.display_warning(f"three.js is not in this wheel: {error}")
