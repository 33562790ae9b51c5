"""Kernels as machine code: what Taichi writes as text for LLVM, compiled and linked for other platforms.

llvmlite 0.44 has the LLVM of Taichi 1.7.4, which alone reads these texts. `ziglang` links for all platforms.
"""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from taichi_soft.core.errors import OptionError
from taichi_soft.export.web import for_web, web_sources

TABLE = "taichi_soft_kernels"
"""Symbol of the table in a file: rows of a name and a function, `ts_linked_kernel` of the C library."""


@dataclass(frozen=True)
class Platform:
    """A processor and a system, for which LLVM compiles and zig links."""

    triple: str  # of LLVM
    target: str  # of zig
    processor: str
    file: str  # without its end
    features: str = ""  # beyond those of the processor

    @property
    def end(self) -> str:
        """The end of a library's name."""
        return {"windows": ".dll", "macos": ".dylib", "web": ".wasm"}.get(self.file.split("-")[0], ".so")

    @property
    def is_web(self) -> bool:
        """Whether the whole library is linked with the kernels."""
        return self.file == "web"


PLATFORMS = {
    "linux-x64": (
        Platform("x86_64-unknown-linux-gnu", "x86_64-linux-gnu", "x86-64-v2", "linux-x64"),
        Platform("x86_64-unknown-linux-gnu", "x86_64-linux-gnu", "x86-64-v3", "linux-x64-v3"),
    ),
    "windows-x64": (
        Platform("x86_64-pc-windows-gnu", "x86_64-windows-gnu", "x86-64-v2", "windows-x64"),
        Platform("x86_64-pc-windows-gnu", "x86_64-windows-gnu", "x86-64-v3", "windows-x64-v3"),
    ),
    "linux-arm64": (Platform("aarch64-unknown-linux-gnu", "aarch64-linux-gnu", "generic", "linux-arm64"),),
    "macos-arm64": (Platform("arm64-apple-macosx11.0", "aarch64-macos", "apple-m1", "macos-arm64"),),
    "web": (
        Platform("wasm32-unknown-unknown", "wasm32-wasi", "generic", "web", "+simd128,+nontrapping-fptoint"),
    ),
}
"""By the name that `taichi-soft export --for` takes."""

_TARGET_LINES = re.compile(r"^target (?:datalayout|triple).*\n", re.MULTILINE)
_PROCESSOR = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_PART = re.compile(r"^define void @(\w+_kernel_(\d+)_\w+)\((%struct\.RuntimeContext[.\d]*\*)", re.MULTILINE)

_FUNCTION = "taichi_soft_kernel_"
"""How functions begin that run all parts of a kernel."""

_WINDOWS = """
int _fltused = 0;
int DllMainCRTStartup(void *library, unsigned reason, void *reserved) { return 1; }
"""
"""Windows looks for these two in every library."""


def platforms_of(names: Sequence[str] | None) -> list[str]:
    """Platforms by name, each once; that of this machine for None. Raises: OptionError for others."""
    if names is None:
        known = {"amd64": "x64", "x86_64": "x64", "aarch64": "arm64", "win32": "windows", "darwin": "macos"}
        system, machine = (known.get(each, each) for each in (sys.platform, platform.machine().lower()))
        names = [f"{system}-{machine}"]
    for name in names:
        if name not in PLATFORMS:
            raise OptionError(f"no platform is called {name}: choose among {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(names))


@dataclass(frozen=True)
class CompiledKernels:
    """Files of machine code, and what says that they belong to a world file."""

    stamp: str  # the library compares it with the one in the world file
    files: list[Path]  # one or more for each platform


def compile_kernels(
    texts: Path, names: Sequence[str], platforms: Sequence[str], folder: Path, world: str | None
) -> CompiledKernels:
    """Compile kernels for platforms.

    Args:
        texts: folder of a file NAME.ll for each kernel.
        platforms: some of `PLATFORMS`.
        folder: for the files.
        world: None for libraries that are opened; a name for objects that a game is linked with, whose table
            is called after it.
    """
    llvm = _llvm()
    sources = {name: _source_of(name, (texts / f"{name}.ll").read_text()) for name in names}
    stamp = f"{zlib.crc32(''.join(sources.values()).encode()):08x}"
    table = TABLE if world is None else f"{TABLE}_{re.sub(r'[^A-Za-z0-9_]', '_', world)}"
    files = []
    for target in (each for name in platforms for each in PLATFORMS[name]):
        code = _object_of(llvm, sources, _table_of(table, stamp, names), target)
        if world is not None:
            files.append(folder / f"{target.file}.o")
            files[-1].write_bytes(code)
            continue
        with TemporaryDirectory() as scratch:
            (Path(scratch) / "kernels.o").write_bytes(code)
            linked = _linked(target, Path(scratch) / "kernels.o")
            files.append(Path(shutil.move(linked, folder / linked.name)))
    return CompiledKernels(stamp, files)


def _llvm() -> Any:
    llvm = import_module("llvmlite.binding")
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
    return f"{text}\ndefine void @{_FUNCTION}{name}({context} %context) {{\n{calls}  ret void\n}}\n"


def _table_of(symbol: str, stamp: str, names: Sequence[str]) -> str:
    """Rows of a name and a function, with the stamp in front and nothing at the end, as text for LLVM."""
    lines, rows = [], []
    for i, text in enumerate([stamp, *names]):
        kind = f"[{len(text) + 1} x i8]"
        lines.append(f'@name{i} = private constant {kind} c"{text}\\00"')
        function = f"bitcast (void (i8*)* @{_FUNCTION}{text} to i8*)" if i else "null"
        place = f"getelementptr inbounds ({kind}, {kind}* @name{i}, i64 0, i64 0)"
        rows.append(f"{{ i8*, i8* }} {{ i8* {place}, i8* {function} }}")
    rows.append("{ i8*, i8* } zeroinitializer")
    lines += [f"declare void @{_FUNCTION}{name}(i8*)" for name in names]
    lines.append(f"@{symbol} = constant [{len(rows)} x {{ i8*, i8* }}] [{', '.join(rows)}]")
    return "\n".join(lines)


def _object_of(llvm: Any, sources: Mapping[str, str], table: str, target: Platform) -> bytes:
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor,
        features=target.features,
        opt=3,
        reloc="static" if target.is_web else "pic",
        codemodel="default",
    )
    whole = llvm.parse_assembly("")
    whole.triple, whole.data_layout = target.triple, str(machine.target_data)
    for source in [*sources.values(), table]:
        module = llvm.parse_assembly(for_web(source) if target.is_web else source)
        module.triple, module.data_layout = whole.triple, whole.data_layout
        whole.link_in(module)
    for name in sources:  # so that a game may have several worlds
        whole.get_function(_FUNCTION + name).linkage = "internal"
    return bytes(machine.emit_object(whole))


def _linked(target: Platform, code: Path) -> Path:
    """A library made of an object file, beside it."""
    linked = code.with_name(target.file + target.end)
    if target.is_web:
        return _zig(linked, "c++", "-target", target.target, *web_sources(), code)
    # What compilers call, to set memory and the like, comes with zig: nothing of a system is linked.
    given: list[str | Path] = ["cc", "-target", target.target, "-shared", "-nostdlib", "-lcompiler_rt", code]
    given.append("-Wl,-dead_strip" if target.end == ".dylib" else "-Wl,--gc-sections")
    if target.end == ".dll":
        start, definitions = code.with_name("start.c"), code.with_name("kernels.def")
        start.write_text(_WINDOWS)
        definitions.write_text(f"EXPORTS\n  {TABLE} DATA\n")
        given += ["-fno-sanitize=all", start, definitions]
    return _zig(linked, *given)


def _zig(linked: Path, *given: str | Path) -> Path:
    """What zig's compilers make of what they are given."""
    command = [sys.executable, "-m", "ziglang", *map(str, given), "-s", "-o", str(linked)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise OptionError(f"cannot link {linked.name}: {done.stderr.strip() or 'zig has failed'}")
    return linked
