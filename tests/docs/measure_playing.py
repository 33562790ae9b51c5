"""Measure how fast the gallery plays in Chromium without a window: frames a second and the cost of a step.

Run `python docs/make_worlds.py`, then `python tests/docs/measure_playing.py [NAME ...]`.
"""

import subprocess
import sys
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "shared"))

from browser import chromium, opened  # noqa: E402

SIZES = ((1280, 800), (768, 1024), (400, 860))
WAIT = 12_000
"""After which the page has chosen how finely it draws [ms]."""


def main(names):
    """Print a line for each scene and size of the window."""
    command = [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1"]
    server = subprocess.Popen(
        [*command, "--directory", str(ROOT / "docs")],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    port = server.stdout.readline().split(" port ")[1].split()[0]
    try:
        with chromium() as browser:
            for name, (width, height) in product(names, SIZES):
                address = f"http://127.0.0.1:{port}/gallery/play/index.html#{name}"
                page, complaints, _ = opened(browser, address, viewport={"width": width, "height": height})
                page.locator("#words").wait_for(state="hidden")
                page.wait_for_timeout(WAIT)
                rate, cost = (page.locator(each).inner_text() for each in ("#rate", "#cost"))
                print(f"{name}, {width} x {height}: {rate}, {cost} a step", *complaints, flush=True)
                page.close()
    finally:
        server.terminate()


if __name__ == "__main__":
    main(sys.argv[1:] or ["jelly"])
