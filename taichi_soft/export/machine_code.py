"""Kernels as machine code: what Taichi writes as text for LLVM, compiled and linked for other platforms.

llvmlite 0.44 has the LLVM of Taichi 1.7.4, which alone reads these texts. `ziglang` links for all platforms.
"""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

from taichi_soft.core.errors import OptionError

PREFIX = "taichi_soft_kernel_"
"""Of the functions that a file has, before the names of kernels."""


@dataclass(frozen=True)
class Platform:
    """What code is compiled for."""

    triple: str  # of LLVM
    target: str  # of zig
    processor: str
    file: str  # by which the library finds it


PLATFORMS = {
    "linux-x64": (
        Platform("x86_64-unknown-linux-gnu", "x86_64-linux-gnu", "x86-64-v2", "linux-x64.so"),
        Platform("x86_64-unknown-linux-gnu", "x86_64-linux-gnu", "x86-64-v3", "linux-x64-v3.so"),
    ),
    "windows-x64": (
        Platform("x86_64-pc-windows-gnu", "x86_64-windows-gnu", "x86-64-v2", "windows-x64.dll"),
        Platform("x86_64-pc-windows-gnu", "x86_64-windows-gnu", "x86-64-v3", "windows-x64-v3.dll"),
    ),
    "linux-arm64": (Platform("aarch64-unknown-linux-gnu", "aarch64-linux-gnu", "generic", "linux-arm64.so"),),
    "macos-arm64": (Platform("arm64-apple-macosx11.0", "aarch64-macos", "apple-m1", "macos-arm64.dylib"),),
}
"""By the name that `taichi-soft export --for` takes."""

_TARGET_LINES = re.compile(r"^target (?:datalayout|triple).*\n", re.MULTILINE)
_PROCESSOR = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_PART = re.compile(r"^define void @(\w+_kernel_(\d+)_\w+)\((%struct\.RuntimeContext[.\d]*\*)", re.MULTILINE)

_WINDOWS = """
int _fltused = 0;
int DllMainCRTStartup(void *library, unsigned reason, void *reserved) { return 1; }
"""
"""What Windows wants of a library."""


def platforms_of(names: Sequence[str] | None) -> list[str]:
    """Platforms by name, each once; that of this machine for None. Raises: OptionError for others."""
    if names is None:
        machine = {"amd64": "x64", "x86_64": "x64", "aarch64": "arm64"}.get(
            platform.machine().lower(), "arm64"
        )
        system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")
        names = [f"{system}-{machine}"]
    for name in names:
        if name not in PLATFORMS:
            raise OptionError(f"no platform is called {name}: choose among {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(names))


def compile_kernels(texts: Path, names: Sequence[str], platforms: Sequence[str], folder: Path) -> list[Path]:
    """Compile kernels for platforms.

    Args:
        texts: folder of a file NAME.ll for each kernel.
        platforms: some of `PLATFORMS`.
        folder: for the files.
    Returns: the files, one or more for each platform.
    """
    llvm = _llvm()
    sources = [_source_of(name, (texts / f"{name}.ll").read_text()) for name in names]
    files = []
    for target in (each for name in platforms for each in PLATFORMS[name]):
        with TemporaryDirectory() as scratch:
            code = Path(scratch) / "kernels.o"
            code.write_bytes(_object_of(llvm, sources, target))
            linked = _linked(target, code, [PREFIX + name for name in names])
            files.append(Path(shutil.move(linked, folder / target.file)))
    return files


def _llvm() -> ModuleType:
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    return llvm


def _source_of(name: str, text: str) -> str:
    """A kernel's text for any target, with a function that runs its parts in their order."""
    text = _PROCESSOR.sub("", _TARGET_LINES.sub("", text))
    parts = sorted((int(number), part, context) for part, number, context in _PART.findall(text))
    for number, part, _ in parts:
        text = text.replace(f"@{part}(", f"@{name}_part_{number}(")
    text = re.sub(
        rf"^define void @{name}_part_", f"define internal void @{name}_part_", text, flags=re.MULTILINE
    )
    context = parts[0][2]
    calls = "".join(f"  call void @{name}_part_{number}({context} %context)\n" for number, _, _ in parts)
    return f"{text}\ndefine void @{PREFIX}{name}({context} %context) {{\n{calls}  ret void\n}}\n"


def _object_of(llvm: ModuleType, sources: Sequence[str], target: Platform) -> bytes:
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor, opt=3, reloc="pic", codemodel="default"
    )
    whole = None
    for source in sources:
        module = llvm.parse_assembly(source)
        module.triple, module.data_layout = target.triple, str(machine.target_data)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    return bytes(machine.emit_object(whole))


def _linked(target: Platform, code: Path, symbols: Sequence[str]) -> Path:
    """A library made of an object file, beside it."""
    linked = code.with_name(target.file)
    # What compilers call, to set memory and the like, comes with zig: nothing of a system is linked.
    command = [
        *(sys.executable, "-m", "ziglang", "cc", "-target", target.target, "-shared", "-nostdlib"),
        *("-lcompiler_rt", "-s", "-o", str(linked), str(code)),
    ]
    if target.target.endswith("windows-gnu"):
        start, definitions = code.with_name("start.c"), code.with_name("kernels.def")
        start.write_text(_WINDOWS)
        definitions.write_text("EXPORTS\n" + "".join(f"  {each}\n" for each in symbols))
        command += ["-fno-sanitize=all", str(start), str(definitions)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise OptionError(f"cannot link {target.file}: {done.stderr.strip() or 'zig has failed'}")
    return linked
