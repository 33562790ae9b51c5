"""Plays a recorded game in Chromium without a window, by the package for JavaScript; prints what it tells:

python play_in_browser.py FOLDER < GAME
"""

import shutil
import sys
import tempfile
from pathlib import Path

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(HERE.parent / "shared"))

# ruff: noqa: E402
from browser import chromium, opened, serving

PAGE = """<!DOCTYPE html><title>games</title><link rel="icon" href="data:,"><script type="module">
import { loadScene } from "./engine_adapter/web/taichi-soft.js";
import { play } from "./tests/native/play.mjs";
window.played = async (game) => play(await loadScene("world"), game);
window.isReady = true;
</script>"""


def main(world):
    """Print the lines. Returns: the exit status, 1 if the browser reports an error."""
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        folder = Path(place)
        shutil.copytree(world, folder / "world")
        shutil.copytree(ROOT / "engine_adapter" / "web", folder / "engine_adapter" / "web")
        (folder / "tests" / "native").mkdir(parents=True)
        shutil.copy(HERE / "play.mjs", folder / "tests" / "native")
        (folder / "index.html").write_text(PAGE)
        with serving(folder) as address:
            page, complaints, _ = opened(browser, f"{address}/index.html")
            page.wait_for_function("window.isReady")
            print(*page.evaluate("(game) => played(game)", sys.stdin.read()), sep="\n")
    print(*complaints, sep="\n", file=sys.stderr)
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
