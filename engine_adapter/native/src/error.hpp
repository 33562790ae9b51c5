// Errors of a call. abi.cpp catches them and converts them to a code and a text.
#pragma once

#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "taichi_soft.h"

namespace taichi_soft {

struct Error : std::runtime_error {
  ts_result code;
  Error(ts_result code, const std::string& text) : std::runtime_error(text), code(code) {}
};

#if defined(__wasm__)
// WebAssembly has no exceptions. Instead, the host throws its own exception and restores the stack.
extern "C" __attribute__((import_module("taichi_soft"), import_name("fail"))) [[noreturn]] void taichi_soft_fail(
    ts_result code, const char* text);
#endif

#if defined(__GNUC__)
[[noreturn]] __attribute__((format(printf, 2, 3)))
#else
[[noreturn]]
#endif
inline void fail(ts_result code, const char* format, ...) {
  char text[512];
  va_list values;
  va_start(values, format);
  std::vsnprintf(text, sizeof text, format, values);
  va_end(values);
#if defined(__wasm__)
  taichi_soft_fail(code, text);
#else
  throw Error(code, text);
#endif
}

}  // namespace taichi_soft
