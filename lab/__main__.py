"""Run the command line `python -m lab`.

Ctrl-C ends the process with one line and exit code 130, even during the imports, which take one or two
seconds.
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
