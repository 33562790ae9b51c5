# Toolchain for other platforms with zig from PyPI (`pip install ziglang`), which includes compilers and C libraries:
#
#     cmake -S engine_adapter/native -B out/windows-x64 -DPLATFORM=windows-x64 \
#           -DCMAKE_TOOLCHAIN_FILE=zig.cmake -DZIG=.venv/lib/python3.12/site-packages/ziglang/zig
#
# Tested with zig 0.17. The libraries for linux-x64, linux-arm64 and windows-x64 were run; the library for macos-arm64
# was only built.
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ZIG PLATFORM)
if(PLATFORM STREQUAL "linux-x64")
  set(target x86_64-linux-gnu.2.28)
  set(CMAKE_SYSTEM_NAME Linux)
elseif(PLATFORM STREQUAL "linux-arm64")
  set(target aarch64-linux-gnu.2.28)
  set(CMAKE_SYSTEM_NAME Linux)
elseif(PLATFORM STREQUAL "windows-x64")
  set(target x86_64-windows-gnu)
  set(CMAKE_SYSTEM_NAME Windows)
elseif(PLATFORM STREQUAL "macos-arm64")
  set(target aarch64-macos.11.0)
  set(CMAKE_SYSTEM_NAME Darwin)
else()
  message(FATAL_ERROR "PLATFORM=${PLATFORM}: give linux-x64, linux-arm64, windows-x64 or macos-arm64")
endif()
set(CMAKE_SYSTEM_PROCESSOR ${PLATFORM})
set(CMAKE_C_COMPILER "${ZIG}")
set(CMAKE_C_COMPILER_ARG1 "cc -target ${target}")
set(CMAKE_CXX_COMPILER "${ZIG}")
set(CMAKE_CXX_COMPILER_ARG1 "c++ -target ${target}")
set(CMAKE_SHARED_LINKER_FLAGS_INIT "-s")
set(CMAKE_EXE_LINKER_FLAGS_INIT "-s")
