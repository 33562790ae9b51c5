"""Compile kernels to machine code for each platform, from the LLVM assembly that Taichi writes.

Only the LLVM version of Taichi 1.7.4 can read this assembly; llvmlite 0.44 contains the same version.
`ziglang` links for all platforms.
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
"""Symbol of the kernel table in a file. Each row is a `ts_linked_kernel` of the C library, with a name and a
function."""


@dataclass(frozen=True)
class Platform:
    """A target platform for LLVM and zig."""

    triple: str  # LLVM's target triple
    target: str  # zig's target
    processor: str
    file: str  # file name without suffix
    features: str = ""  # additional CPU features

    @property
    def end(self) -> str:
        """Suffix of a library's file name."""
        return {"windows": ".dll", "macos": ".dylib", "web": ".wasm"}.get(self.file.split("-")[0], ".so")

    @property
    def is_web(self) -> bool:
        """True for WebAssembly. Its native library and its kernels are linked into one file."""
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
"""Targets of each platform, by its name in `taichi-soft export --for`."""

_TARGET_LINES = re.compile(r"^target (?:datalayout|triple).*\n", re.MULTILINE)
_PROCESSOR = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_PART = re.compile(r"^define void @(\w+_kernel_(\d+)_\w+)\((%struct\.RuntimeContext[.\d]*\*)", re.MULTILINE)

_FUNCTION = "taichi_soft_kernel_"
"""Prefix of the names of functions that run all parts of a kernel."""

_WINDOWS = """
int _fltused = 0;
int DllMainCRTStartup(void *library, unsigned reason, void *reserved) { return 1; }
"""
"""LLVM assembly of the symbols that Windows requires in every library."""


def platforms_of(names: Sequence[str] | None) -> list[str]:
    """Check names of platforms and return them without duplicates. None means the platform of this machine.

    Raises: OptionError for an unknown name.
    """
    if names is None:
        known = {"amd64": "x64", "x86_64": "x64", "aarch64": "arm64", "win32": "windows", "darwin": "macos"}
        system, machine = (known.get(each, each) for each in (sys.platform, platform.machine().lower()))
        names = [f"{system}-{machine}"]
    for name in names:
        if name not in PLATFORMS:
            raise OptionError(f"unknown platform {name}: choose among {', '.join(PLATFORMS)}")
    return list(dict.fromkeys(names))


@dataclass(frozen=True)
class CompiledKernels:
    """Files of machine code, and the stamp that identifies the world file to which they belong."""

    stamp: str  # equal to the stamp in the world file; the library compares both
    files: list[Path]  # one or more per platform


def compile_kernels(
    texts: Path, names: Sequence[str], platforms: Sequence[str], folder: Path, world: str | None
) -> CompiledKernels:
    """Compile kernels to machine code for one or more platforms.

    Args:
        texts: folder with the assembly of each kernel in a file NAME.ll.
        names: names of the kernels.
        platforms: names from `PLATFORMS`.
        folder: folder for the output.
        world: None writes shared libraries. A name writes object files to link into a game, and is part of
            the table's symbol.
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
    """Return a kernel's assembly without its target platform. Add a function that runs the kernel's parts in
    order.
    """
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
    """Return the kernel table as LLVM assembly. The stamp is in the first row, and the last row is null."""
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
    for name in sources:  # internal, so that a game can link several worlds
        whole.get_function(_FUNCTION + name).linkage = "internal"
    return bytes(machine.emit_object(whole))


def _linked(target: Platform, code: Path) -> Path:
    """Link an object file to a library in the same folder. Return its path."""
    linked = code.with_name(target.file + target.end)
    if target.is_web:
        return _zig(linked, "c++", "-target", target.target, *web_sources(), code)
    # zig provides runtime functions such as memset, so no system library is linked.
    given: list[str | Path] = ["cc", "-target", target.target, "-shared", "-nostdlib", "-lcompiler_rt", code]
    given.append("-Wl,-dead_strip" if target.end == ".dylib" else "-Wl,--gc-sections")
    if target.end == ".dll":
        start, definitions = code.with_name("start.c"), code.with_name("kernels.def")
        start.write_text(_WINDOWS)
        definitions.write_text(f"EXPORTS\n  {TABLE} DATA\n")
        given += ["-fno-sanitize=all", start, definitions]
    return _zig(linked, *given)


def _zig(linked: Path, *given: str | Path) -> Path:
    """Run zig's compiler with the output `linked`. Return its path."""
    command = [sys.executable, "-m", "ziglang", *map(str, given), "-s", "-o", str(linked)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise OptionError(f"cannot link {linked.name}: {done.stderr.strip() or 'zig failed'}")
    return linked
