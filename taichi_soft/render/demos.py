"""Find and load the demos in `demos/`."""

from __future__ import annotations

import importlib.util
from types import ModuleType

from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.package_data import DEMOS


def demo_names() -> list[str]:
    """List the names of the demos that define a stage. Demos without a stage are separate programs."""
    stages = (path for path in DEMOS.glob("[a-z]*.py") if "\ndef stage(" in path.read_text(encoding="utf-8"))
    return sorted(path.stem for path in stages)


def load_demo(name: str) -> ModuleType:
    """Load a demo, a module with `stage()` and `proof(stage)`. Raises: OptionError."""
    names = demo_names()
    if name not in names:
        raise OptionError(f"unknown demo {name!r}: {choose_one_of(names, name)}")
    spec = importlib.util.spec_from_file_location(f"taichi_soft_demo_{name}", DEMOS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
