"""Describe the machine and the packages of a report."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("taichi-soft", "taichi", "numpy", "scipy", "scikit-fem")


def machine_facts(arch: str) -> dict[str, str]:
    """Return facts about the machine and the packages, by name; `arch` is Taichi's name of the device."""
    return {
        "device": f"{arch}, one thread per process",
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "platform": platform.platform(),
        "python": platform.python_version(),
        **{name: _version_of(name) for name in PACKAGES},
    }


def _processor() -> str:
    """Return the name of the processor; its architecture if the name is unknown."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version_of(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
