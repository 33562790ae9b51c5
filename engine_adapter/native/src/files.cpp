// Reads world files and libraries of kernels. Builds for the web use web.cpp instead of this file.
#include <algorithm>
#include <filesystem>
#include <fstream>

#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "archive.hpp"
#include "error.hpp"
#include "kernels.hpp"
#include "scene.hpp"

namespace taichi_soft {

namespace {

std::string path_of(const std::string& folder, const char* name) {
  return (std::filesystem::u8path(folder) / name).u8string();
}

// Names of the kernel files that this machine can run, the fastest first.
std::vector<std::string> wanted_files() {
#if defined(_WIN32)
  const std::string platform = "windows", end = ".dll";
#elif defined(__APPLE__)
  const std::string platform = "macos", end = ".dylib";
#else
  const std::string platform = "linux", end = ".so";
#endif
#if defined(__x86_64__) || defined(_M_X64)
#if defined(__GNUC__)
  const bool is_v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  const bool is_v3 = false;
#endif
  std::vector<std::string> found = {platform + "-x64" + end};
  if (is_v3) found.insert(found.begin(), platform + "-x64-v3" + end);
  return found;
#else
  return {platform + "-arm64" + end};
#endif
}

std::string texts(const std::vector<std::string>& names) {
  std::string found;
  for (const std::string& name : names) found += (found.empty() ? "" : ", ") + name;
  return found.empty() ? "nothing" : found;
}

// Index of the fastest existing file for this machine. A game can contain only some of the exported files.
size_t choose(const std::filesystem::path& folder, const std::vector<std::string>& files) {
  const std::vector<std::string> wanted = wanted_files();
  std::filesystem::path missing;
  for (const std::string& name : wanted) {
    const auto found = std::find(files.begin(), files.end(), name);
    if (found == files.end()) continue;
    missing = std::filesystem::absolute(folder / name);
    std::error_code ignored;
    if (std::filesystem::exists(missing, ignored)) return size_t(found - files.begin());
  }
  if (!missing.empty()) {
    fail(TS_ERROR_FILE, "cannot read %s, which belongs to the world file: copy it there, or export the world again",
         missing.u8string().c_str());
  }
  const std::filesystem::path platform = wanted.back();
  const bool is_linked = !files.empty() && std::filesystem::path(files[0]).extension() == ".o";
  const std::string way_out = is_linked ? "call ts_scene_load_linked, or export it again without --static"
                                        : "export it again, with --for " + platform.stem().string();
  fail(TS_ERROR_FILE, "the world file has no machine code for this machine, %s, but %s: %s", wanted.back().c_str(),
       texts(files).c_str(), way_out.c_str());
}

}  // namespace

Kernels::Kernels(const std::string& folder, const std::vector<std::string>& files, const std::vector<int64_t>& sums) {
  const size_t file = choose(std::filesystem::u8path(folder), files);
  const std::filesystem::path path = std::filesystem::absolute(std::filesystem::u8path(folder) / files[file]);
  const std::vector<char> bytes = read_file(path.u8string());
  if (int64_t(bytes.size()) != sums[2 * file] || int64_t(checksum(bytes.data(), bytes.size())) != sums[2 * file + 1]) {
    fail(TS_ERROR_FILE, "the world file is damaged: kernels/%s differs from the exported file. Export it again",
         files[file].c_str());
  }
  constexpr char kTable[] = "taichi_soft_kernels";
#if defined(_WIN32)
  library_ = LoadLibraryW(path.c_str());
  if (library_ == nullptr) {
    fail(TS_ERROR_FILE, "Windows cannot load %s: error %lu", path.u8string().c_str(), GetLastError());
  }
  void* table = reinterpret_cast<void*>(GetProcAddress(static_cast<HMODULE>(library_), kTable));
#else
  library_ = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library_ == nullptr) fail(TS_ERROR_FILE, "cannot open %s: %s", path.c_str(), dlerror());
  void* table = dlsym(library_, kTable);
#endif
  rows_ = static_cast<const ts_linked_kernel*>(table);
  if (rows_ == nullptr) {
    close();
    fail(TS_ERROR_FILE, "kernels/%s has no kernels: export the world again", files[file].c_str());
  }
}

void Kernels::close() {
  if (library_ == nullptr) return;
#if defined(_WIN32)
  FreeLibrary(static_cast<HMODULE>(library_));
#else
  dlclose(library_);
#endif
}

std::vector<char> read_file(const std::string& path) {
  std::ifstream file(std::filesystem::u8path(path), std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : -1;
  if (size < 0 || size > (std::streamoff(1) << 40)) {
    fail(TS_ERROR_FILE, "cannot read %s: give a folder from `taichi-soft export`", path.c_str());
  }
  std::vector<char> found(static_cast<size_t>(size));
  file.seekg(0);
  if (!found.empty() && !file.read(found.data(), size)) {
    fail(TS_ERROR_FILE, "cannot read %s", path.c_str());
  }
  return found;
}

Scene::Scene(const std::string& folder) : Scene(read_file(path_of(folder, "world.tsw")), path_of(folder, "world.tsw")) {
  const auto sums = archive.rows<int64_t>("kernels/sums", 2);
  const auto files = archive.texts("kernels/files");
  if (sums.count != 2 * files.size()) {
    fail(TS_ERROR_FILE, "the world file is invalid: kernels. Export it again");
  }
  take(std::make_unique<Kernels>(path_of(folder, "kernels"), files, std::vector<int64_t>(sums.begin(), sums.end())));
}

}  // namespace taichi_soft
