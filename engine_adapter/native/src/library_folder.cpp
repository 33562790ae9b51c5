#include "library_folder.hpp"

#include <cstdlib>
#include <filesystem>
#include <string>

#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "error.hpp"

namespace taichi_soft {

namespace {

std::filesystem::path library_path() {
#if defined(_WIN32)
  HMODULE library = nullptr;
  wchar_t name[32768];
  GetModuleHandleExW(GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT,
                     reinterpret_cast<LPCWSTR>(&library_path), &library);
  GetModuleFileNameW(library, name, 32768);
  return name;
#else
  Dl_info info{};
  dladdr(reinterpret_cast<void*>(&library_path), &info);
  return info.dli_fname == nullptr ? "" : info.dli_fname;
#endif
}

}  // namespace

void use_runtime_beside_library() {
  if (std::getenv("TI_LIB_DIR") != nullptr) return;
  const std::filesystem::path folder = std::filesystem::absolute(library_path()).parent_path();
  if (!std::filesystem::exists(folder / "runtime_x64.bc")) {
    fail(TS_ERROR_RUNTIME, "runtime_x64.bc is not beside the library, in %s: put it there", folder.string().c_str());
  }
#if defined(_WIN32)
  _putenv_s("TI_LIB_DIR", folder.string().c_str());
#else
  setenv("TI_LIB_DIR", folder.c_str(), 1);
#endif
}

}  // namespace taichi_soft
