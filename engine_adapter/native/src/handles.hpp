// Maps handles to objects. Handles are numbers, because invalid numbers can be detected and dangling pointers cannot.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "error.hpp"
#include "locks.hpp"

namespace taichi_soft {

// Reference to an object during a call. In WebAssembly the reference is a raw pointer, because a refused call runs no
// destructors. The raw pointer is safe, because WebAssembly has only one thread.
#if defined(__wasm__)
template <typename Thing>
using Kept = Thing*;
#else
template <typename Thing>
using Kept = std::shared_ptr<Thing>;
#endif

template <typename Thing>
class Handles {
 public:
  // `kind` is a different number for each kind of object, so that handles of different kinds differ.
  Handles(const char* name, uint64_t kind) : name_(name), kind_(kind << 56) {}

  uint64_t add(std::shared_ptr<Thing> thing) {
    const Guard lock(mutex_);
    size_t row = 0;
    while (row < rows_.size() && rows_[row].thing) ++row;
    if (row == rows_.size()) rows_.push_back({});
    rows_[row].thing = std::move(thing);
    rows_[row].generation = (rows_[row].generation + 1) & kGenerations;
    return kind_ | uint64_t(rows_[row].generation) << 32 | (row + 1);
  }

  Kept<Thing> find(uint64_t handle) {
    const Guard lock(mutex_);
#if defined(__wasm__)
    return row_of(handle).thing.get();
#else
    return row_of(handle).thing;
#endif
  }

  std::shared_ptr<Thing> share(uint64_t handle) {
    const Guard lock(mutex_);
    return row_of(handle).thing;
  }

  // Removes a handle. The object exists until all running calls that use it have ended.
  std::shared_ptr<Thing> remove(uint64_t handle) {
    const Guard lock(mutex_);
    return std::move(row_of(handle).thing);
  }

 private:
  struct Row {
    std::shared_ptr<Thing> thing;
    uint32_t generation = 0;
  };

  Row& row_of(uint64_t handle) {
    const uint64_t row = (handle & 0xFFFFFFFFu) - 1;
    if (handle == 0 || row >= rows_.size() || !rows_[row].thing ||
        (kind_ | uint64_t(rows_[row].generation) << 32) != (handle & ~uint64_t(0xFFFFFFFFu))) {
      fail(TS_ERROR_HANDLE, "%s %llu does not exist, or was destroyed", name_, static_cast<unsigned long long>(handle));
    }
    return rows_[row];
  }

  static constexpr uint32_t kGenerations = 0xFFFFFF;

  const char* name_;
  uint64_t kind_;
  Mutex mutex_;
  std::vector<Row> rows_;
};

}  // namespace taichi_soft
