// Threads of a world: they run the tasks of a loop beside the one that calls.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "kernels.hpp"

namespace taichi_soft {

class Threads {
 public:
  Threads() = default;
  ~Threads();
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

  // Runs tasks 0 to count - 1 and returns when all have ended. Threads are started as they are needed.
  void run(int32_t count, void* closure, Task task);

 private:
  void serve(int32_t thread, uint64_t done);  // after the round that was done when it started
  void take_tasks(int32_t thread);

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable begins_, ends_;
  uint64_t round_ = 0;  // that is run, or was last
  int32_t busy_ = 0;    // workers that have not ended it
  bool is_over_ = false;
  void* closure_ = nullptr;
  Task task_ = nullptr;
  int32_t count_ = 0;
  std::atomic<int32_t> next_{0};
};

}  // namespace taichi_soft
