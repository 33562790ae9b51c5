// Runs the tasks of a loop on the calling thread and on threads of the world or of the host.
#pragma once

#include <cstdint>

#include "kernels.hpp"
#include "taichi_soft.h"

#if !defined(__wasm__)
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>
#endif

namespace taichi_soft {

class Threads {
 public:
  Threads();
  ~Threads();
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

  int32_t most() const { return most_; }  // largest number of threads, including the calling thread
  void set_most(int32_t count) { most_ = count; }
  void use_host(ts_run_jobs function, void* user) { host_ = function, user_ = user; }

  // Runs tasks 0 to count - 1, which are started in this order. Returns after all tasks have ended. Creates threads on
  // demand.
  void run(int32_t count, void* closure, Task task);

 private:
  int32_t most_;
  ts_run_jobs host_ = nullptr;
  void* user_ = nullptr;
#if !defined(__wasm__)
  void run_on_workers(int32_t count, void* closure, Task task);
  int32_t helpers_for(int32_t count) noexcept;
  void serve(int32_t thread, uint64_t done);  // waits for rounds after round `done`
  void take_tasks(int32_t thread);

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable begins_, ends_;
  uint64_t round_ = 0;   // current or last round
  int32_t helpers_ = 0;  // number of workers in this round: the first workers in `workers_`
  int32_t busy_ = 0;     // number of workers that have not finished the round
  bool is_over_ = false;
  void* closure_ = nullptr;
  Task task_ = nullptr;
  int32_t count_ = 0;
  std::atomic<int32_t> next_{0};
#endif
};

}  // namespace taichi_soft
