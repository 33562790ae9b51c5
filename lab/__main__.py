"""`python -m lab`: the command line.

Importing it takes a second or two. Ctrl-C ends the process in that time too, by one line and exit code 130.
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
        signal.signal(signal.SIGINT, signal.default_int_handler)  # commands clean up after Ctrl-C
        main()
    except KeyboardInterrupt:
        _end()
