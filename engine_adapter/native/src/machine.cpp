#include "machine.hpp"

#include <taichi/taichi_cpu.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <mutex>

#include "error.hpp"
#include "floats.hpp"
#include "library_folder.hpp"
#include "scene.hpp"

namespace taichi_soft {

namespace {

std::mutex creation;  // two runtimes that are made at once end the process

void require_no_error(const char* what) {
  char text[256] = "";
  uint64_t size = sizeof text;
  const TiError error = ti_get_last_error(&size, text);
  if (error < TI_ERROR_SUCCESS) {
    ti_set_last_error(TI_ERROR_SUCCESS, nullptr);
    fail(TS_ERROR_RUNTIME, "Taichi has failed to %s: %s", what, text);
  }
}

}  // namespace

char* Buffer::reserve(TiRuntime runtime, size_t size) {
  if (size > size_ || memory_ == nullptr) {
    size_t larger = size_ == 0 ? 64 : size_;
    while (larger < size) larger *= 2;
    blocks_.push_back(std::make_unique<double[]>((larger + 7) / 8));
    memory_ = ti_import_cpu_memory(runtime, blocks_.back().get(), larger);
    require_no_error("take memory");
    size_ = larger;
  }
  return reinterpret_cast<char*>(blocks_.back().get());
}

TiArgument Machine::whole(int32_t value) {
  TiArgument found{};
  found.type = TI_ARGUMENT_TYPE_I32;
  found.value.i32 = value;
  return found;
}

TiArgument Machine::real(double value) {
  TiArgument found{};
  found.type = TI_ARGUMENT_TYPE_F32;
  found.value.f32 = static_cast<float>(value);
  return found;
}

TiArgument Machine::array(TiMemory memory, TiDataType type, uint32_t rows, uint32_t width) {
  TiArgument found{};
  found.type = TI_ARGUMENT_TYPE_NDARRAY;
  found.value.ndarray.memory = memory;
  found.value.ndarray.elem_type = type;
  found.value.ndarray.shape.dim_count = width == 0 ? 1 : 2;
  found.value.ndarray.shape.dims[0] = rows;
  found.value.ndarray.shape.dims[1] = width;
  return found;
}

Machine::Machine(const Scene& scene, const std::string& kernels) {
  const std::lock_guard<std::mutex> lock(creation);
  const WithUsualFloats floats;  // threads that Taichi starts now compute so, too
  use_runtime_beside_library();
  runtime_ = ti_create_runtime(TI_ARCH_X64, 0);
  try {
    require_no_error("start");
    module_ = ti_load_aot_module(runtime_, kernels.c_str());
    require_no_error("read kernels");
    for (const std::string& name : scene.archive.texts("kernels/names")) {
      kernels_[name] = ti_get_aot_module_kernel(module_, name.c_str());
      require_no_error("compile a kernel");
    }
    for (const Mesh& mesh : scene.meshes) {
      ints_.push_back(import(mesh.ints.data, mesh.ints.count * sizeof(int32_t)));
      floats_.push_back(import(mesh.floats.data, mesh.floats.count * sizeof(float)));
    }
    auto* address = found.room<uint64_t>(runtime_, 1);
    launch("read_root", {array(found.memory(), TI_DATA_TYPE_U64, 1)});
    root_ = reinterpret_cast<char*>(static_cast<uintptr_t>(*address)) - scene.place("particle_position").offset;
  } catch (...) {
    ti_destroy_runtime(runtime_);
    throw;
  }
}

Machine::~Machine() {
  const std::lock_guard<std::mutex> lock(creation);
  ti_destroy_aot_module(module_);
  ti_destroy_runtime(runtime_);
}

TiMemory Machine::import(const void* data, size_t size) {
  const TiMemory memory = ti_import_cpu_memory(runtime_, const_cast<void*>(data), size);
  require_no_error("take memory");
  return memory;
}

void Machine::launch(const char* kernel, const std::vector<TiArgument>& arguments) {
  const WithUsualFloats floats;
  ti_launch_kernel(runtime_, kernels_.at(kernel), static_cast<uint32_t>(arguments.size()), arguments.data());
  ti_wait(runtime_);
  require_no_error("run a kernel");
}

}  // namespace taichi_soft
