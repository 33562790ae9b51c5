// A Taichi runtime with the kernels of a world file and memory for its fields: what a world runs on.
#pragma once

#include <taichi/taichi.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace taichi_soft {

class Scene;

// Memory that kernels are given: it grows, and stays where it is otherwise.
class Buffer {
 public:
  template <typename Number>
  Number* room(TiRuntime runtime, size_t count) {
    return reinterpret_cast<Number*>(reserve(runtime, count * sizeof(Number)));
  }
  TiMemory memory() const { return memory_; }

 private:
  char* reserve(TiRuntime runtime, size_t size);

  std::vector<std::unique_ptr<double[]>> blocks_;  // outgrown ones too: Taichi cannot be told to forget them
  size_t size_ = 0;
  TiMemory memory_ = nullptr;
};

class Machine {
 public:
  Machine(const Scene& scene, const std::string& kernels);
  ~Machine();
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;

  char* root() const { return root_; }
  TiRuntime runtime() const { return runtime_; }

  // Arguments of kernels, in their order.
  static TiArgument whole(int32_t value);
  static TiArgument real(double value);
  static TiArgument array(TiMemory memory, TiDataType type, uint32_t rows, uint32_t width = 0);
  void launch(const char* kernel, const std::vector<TiArgument>& arguments);

  TiMemory ints_of(size_t mesh) const { return ints_[mesh]; }
  TiMemory floats_of(size_t mesh) const { return floats_[mesh]; }

  Buffer numbers, rows, found, vertices, frames, positions, normals;

 private:
  TiMemory import(const void* data, size_t size);

  TiRuntime runtime_ = nullptr;
  TiAotModule module_ = nullptr;
  std::map<std::string, TiKernel> kernels_;
  std::vector<TiMemory> ints_, floats_;
  char* root_ = nullptr;
};

}  // namespace taichi_soft
