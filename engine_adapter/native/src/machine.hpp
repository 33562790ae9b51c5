// Owns the memory of one world and calls its kernels.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernels.hpp"
#include "threads.hpp"

namespace taichi_soft {

class Scene;

// Memory for kernel arguments, which grows on demand.
class Buffer {
 public:
  template <typename Number>
  Number* room(size_t count) {
    const size_t words = (count * sizeof(Number) + 7) / 8;
    if (words > words_.size()) words_.resize(2 * words);
    return reinterpret_cast<Number*>(words_.data());
  }
  const void* data() const { return words_.data(); }

 private:
  std::vector<double> words_;
};

struct Argument {
  enum { kWhole, kReal, kArray } kind;
  int32_t whole;
  float real;
  const void* data;
  int32_t rows, width;  // with a width of 0, the array has only one dimension
};

class Machine {
 public:
  explicit Machine(const Scene& scene);

  char* root() const { return root_; }  // address of the fields

  // Kernel arguments.
  static Argument whole(int32_t value) { return {Argument::kWhole, value, 0.0f, nullptr, 0, 0}; }
  static Argument real(double value) { return {Argument::kReal, 0, float(value), nullptr, 0, 0}; }
  static Argument array(const void* data, uint32_t rows, uint32_t width = 0) {
    return {Argument::kArray, 0, 0.0f, data, int32_t(rows), int32_t(width)};
  }
  static Argument array(const Buffer& buffer, uint32_t rows, uint32_t width = 0) {
    return array(buffer.data(), rows, width);
  }
  // Runs a kernel. Returns: the kernel's return value, if the kernel has one.
  float launch(const char* kernel, const std::vector<Argument>& arguments);

  Threads threads;
  Buffer numbers, rows, found, vertices, frames, positions, normals;

 private:
  const Scene& scene_;
  std::vector<char> fields_, temporaries_, packed_;
  char* root_;
  std::unique_ptr<Runtime> runtime_;
};

}  // namespace taichi_soft
