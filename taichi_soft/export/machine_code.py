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

import engine_adapter
from taichi_soft.core.errors import OptionError

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
    "web": (Platform("wasm32-unknown-unknown", "wasm32-wasi", "generic", "web", "+simd128,+nontrapping-fptoint"),),
}
"""By the name that `taichi-soft export --for` takes."""

_TARGET_LINES = re.compile(r"^target (?:datalayout|triple).*\n", re.MULTILINE)
_PROCESSOR = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_LOOP = re.compile(r"^define internal void @cpu_parallel_range_for_task\(.*?^}\n", re.MULTILINE | re.DOTALL)
_CLOSURE = re.compile(r"^  %\S+ = alloca (%\S+), align 8\n(?=(?:(?!^}).)*@cpu_parallel_range_for_task)", re.MULTILINE | re.DOTALL)
_PART = re.compile(r"^define void @(\w+_kernel_(\d+)_\w+)\((%struct\.RuntimeContext[.\d]*\*)", re.MULTILINE)

_SERIAL_LOOP = """
define internal void @cpu_parallel_range_for_task(i8* %given, i32 %thread, i32 %number) {{
entry:
  %closure = bitcast i8* %given to {closure}*
  %at0 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 0
  %at1 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 1
  %at2 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 2
  %at3 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 3
  %at4 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 4
  %at5 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 5
  %at6 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 6
  %at7 = getelementptr inbounds {closure}, {closure}* %closure, i32 0, i32 7
  %context = load {context}, {context}* %at0
  %prologue = load void ({context}, i8*)*, void ({context}, i8*)** %at1
  %body = load void ({context}, i8*, i32)*, void ({context}, i8*, i32)** %at2
  %epilogue = load void ({context}, i8*)*, void ({context}, i8*)** %at3
  %size = load i64, i64* %at4
  %first = load i32, i32* %at5
  %last = load i32, i32* %at6
  %count = load i32, i32* %at7
  %memory = alloca i8, i64 %size, align 8
  %before = mul i32 %count, %number
  %begin = add i32 %first, %before
  %behind = add i32 %begin, %count
  %is_short = icmp slt i32 %behind, %last
  %end = select i1 %is_short, i32 %behind, i32 %last
  %has_prologue = icmp ne void ({context}, i8*)* %prologue, null
  br i1 %has_prologue, label %start, label %check
start:
  call void %prologue({context} %context, i8* %memory)
  br label %check
check:
  %i = phi i32 [ %begin, %entry ], [ %begin, %start ], [ %next, %work ]
  %goes_on = icmp slt i32 %i, %end
  br i1 %goes_on, label %work, label %done
work:
  call void %body({context} %context, i8* %memory, i32 %i)
  %next = add i32 %i, 1
  br label %check
done:
  %has_epilogue = icmp ne void ({context}, i8*)* %epilogue, null
  br i1 %has_epilogue, label %finish, label %leave
finish:
  call void %epilogue({context} %context, i8* %memory)
  br label %leave
leave:
  ret void
}}
"""
"""One part of a loop forwards, as Taichi's runtime has it, but with the places that LLVM chooses."""

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
        machine = {"amd64": "x64", "x86_64": "x64", "aarch64": "arm64"}.get(
            platform.machine().lower(), "arm64"
        )
        system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")
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


def _for_web(source: str) -> str:
    """A kernel's text for pointers of 32 bits: Taichi has places of 64 in what runs the parts of a loop."""
    if not _LOOP.search(source):
        return source
    (closure,) = set(_CLOSURE.findall(source))
    (context,) = set(re.findall(rf"^define void @{_FUNCTION}\w+\((\S+) %context\)", source, re.MULTILINE))
    return _LOOP.sub(lambda _: _SERIAL_LOOP.format(closure=closure, context=context), source)


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
        module = llvm.parse_assembly(_for_web(source) if target.is_web else source)
        module.triple, module.data_layout = whole.triple, whole.data_layout
        whole.link_in(module)
    for name in sources:  # so that a game may have several worlds
        whole.get_function(_FUNCTION + name).linkage = "internal"
    return bytes(machine.emit_object(whole))


def _linked(target: Platform, code: Path) -> Path:
    """A library made of an object file, beside it."""
    linked = code.with_name(target.file + target.end)
    if target.is_web:
        return _linked_for_web(code, linked)
    # What compilers call, to set memory and the like, comes with zig: nothing of a system is linked.
    command = [
        *(sys.executable, "-m", "ziglang", "cc", "-target", target.target, "-shared", "-nostdlib"),
        *("-lcompiler_rt", "-s", "-o", str(linked), str(code)),
    ]
    if target.end == ".dll":
        start, definitions = code.with_name("start.c"), code.with_name("kernels.def")
        start.write_text(_WINDOWS)
        definitions.write_text(f"EXPORTS\n  {TABLE} DATA\n")
        command += ["-fno-sanitize=all", str(start), str(definitions)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise OptionError(f"cannot link {linked.name}: {done.stderr.strip() or 'zig has failed'}")
    return linked


def _linked_for_web(code: Path, linked: Path) -> Path:
    """The whole library with the kernels, as one module."""
    native = Path(engine_adapter.__file__).parent / "native"
    sources = [each for each in sorted((native / "src").glob("*.cpp")) if each.name != "files.cpp"]
    command = [
        *(sys.executable, "-m", "ziglang", "c++", "-target", "wasm32-wasi", "-mexec-model=reactor"),
        *("-std=c++17", "-O2", "-fno-exceptions", "-fno-rtti", "-msimd128", "-ffp-contract=off", "-fvisibility=hidden"),
        *("-DTAICHI_SOFT_BUILDS", f"-I{native / 'include'}", *map(str, sources), str(code)),
        *("-Wl,--export-dynamic", "-Wl,--export=malloc", "-Wl,--export=free", "-Wl,--export=__stack_pointer"),
        *("-s", "-o", str(linked)),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise OptionError(f"cannot link {linked.name}: {done.stderr.strip() or 'zig has failed'}")
    return linked
