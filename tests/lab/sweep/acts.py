"""Functions that tests compute at points, in any process."""

import os
import signal
import time
from math import nan

import numpy as np


def act(point):
    """Do what `point["do"]` says, and say who did it and when."""
    begun = time.time()
    if "log" in point:
        with open(point["log"], "a") as file:
            file.write(f"{point['x']}\n")
    match point.get("do"):
        case "raise":
            raise ValueError("no\nnumbers")
        case "exit":
            os._exit(7)
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "sleep":
            time.sleep(point["seconds"])
        case "numpy":
            return {"value": np.float32(1)}
        case "number":
            return 1.0
    return {"root": len(str(point["x"])) ** 0.5, "pair": (1, nan), "pid": os.getpid(), "begun": begun}


def root(point):
    """Return a number with all its digits."""
    return {"root": point["x"] ** 0.5, "kinds": [True, "a", [1e-300]]}
