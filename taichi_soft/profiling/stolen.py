"""Measure steal time: CPU time that the host of this machine gave to other machines."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

TIMES = Path("/proc/stat")


class Ticks(NamedTuple):
    """CPU time of all cores since the start of the machine [ticks]."""

    wanted: int
    stolen: int


def processor_ticks() -> Ticks | None:
    """Return the CPU times in /proc/stat (user, nice, system, idle, iowait, irq, softirq, steal); None on
    other systems.
    """
    if not TIMES.exists():
        return None
    times = [int(number) for number in TIMES.read_text().split("\n", 1)[0].split()[1:9]]
    return Ticks(sum(times) - sum(times[3:5]), times[7])


def stolen_since(before: Ticks | None) -> float | None:
    """Return the stolen fraction of the requested CPU time since `before`. Return None if the system does not
    report steal time.
    """
    now = processor_ticks()
    if before is None or now is None:
        return None
    return (now.stolen - before.stolen) / max(now.wanted - before.wanted, 1)
