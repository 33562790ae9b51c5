"""Build a WebAssembly module from kernels and the native library, and the JavaScript package for a page."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import engine_adapter

_HERE = Path(engine_adapter.__file__).parent

_LOOP = re.compile(r"^define internal void @cpu_parallel_range_for_task\(.*?^}\n", re.MULTILINE | re.DOTALL)
_CLOSURE = re.compile(
    r"alloca (%\S+), align 8\n(?=(?:(?!^}).)*@cpu_parallel_range_for_task)", re.MULTILINE | re.DOTALL
)
_CONTEXT = re.compile(r"^define void @\w+\((%struct\.RuntimeContext\S*) %context\)", re.MULTILINE)

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
"""Assembly of a function that runs one part of a loop. Only its struct offsets differ from Taichi's code."""


def for_web(source: str) -> str:
    """Return a kernel's assembly for 32-bit pointers. Replace Taichi's loop runner, whose struct offsets are
    for 64-bit pointers.
    """
    if not _LOOP.search(source):
        return source
    (closure,), (context,) = set(_CLOSURE.findall(source)), set(_CONTEXT.findall(source))
    return _LOOP.sub(lambda _: _SERIAL_LOOP.format(closure=closure, context=context), source)


def web_sources() -> list[str | Path]:
    """Return the compiler arguments for the native library, which is linked with a world's kernels."""
    native = _HERE / "native"
    return [
        # Optimise the native library for size, but optimise standard functions that kernels call for speed.
        *("-mexec-model=reactor", "-std=c++17", "-O2", "-Xclang", "-Os", "-msimd128", "-ffp-contract=off"),
        *(
            "-fno-exceptions",
            "-fno-rtti",
            "-fvisibility=hidden",
            "-DTAICHI_SOFT_BUILDS",
            f"-I{native / 'include'}",
        ),
        *("-Wl,--export-dynamic", "-Wl,--export=malloc", "-Wl,--export=free", "-Wl,--export=__stack_pointer"),
        *(each for each in sorted((native / "src").glob("*.cpp")) if each.name != "files.cpp"),
    ]


def write_package(folder: Path) -> None:
    """Copy the JavaScript package and its type declarations to the folder of a world."""
    for file in sorted((_HERE / "web").glob("*.[jt]s")):
        shutil.copyfile(file, folder / file.name)
