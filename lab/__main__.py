"""Run the command line `python -m lab`.

On Ctrl-C, the process prints one line and ends with exit code 130, even during the imports.
"""

import os
import signal
from typing import Any


def _end(*_: Any) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, _end)
    from lab.cli import main

    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # so that commands can clean up after Ctrl-C
        main()
    except KeyboardInterrupt:
        _end()
