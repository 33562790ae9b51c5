"""Build hook that adds three.js to a wheel. Without a network, `taichi-soft live` fetches three.js later."""

import runpy
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class FetchThreeJs(BuildHookInterface):
    """Hatchling's hook that fetches three.js, see `taichi_soft/live/three_js.py`."""

    def initialize(self, version, build_data):
        """Fetch three.js before hatchling collects the files. Without a network, display a warning."""
        try:
            runpy.run_path(str(Path(self.root) / "taichi_soft" / "live" / "three_js.py"))["fetch_three_js"]()
        except OSError as error:
            self.app.display_warning(f"three.js is not in this wheel: {error}")
