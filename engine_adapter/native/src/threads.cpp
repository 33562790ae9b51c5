#include "threads.hpp"

#include <algorithm>
#include <exception>

#include "floats.hpp"

namespace taichi_soft {

namespace {

struct Loop {
  void* closure;
  Task task;
};

void run_job(void* loop, int32_t number) {
  const WithUsualFloats floats;
  static_cast<Loop*>(loop)->task(static_cast<Loop*>(loop)->closure, 0, number);
}

}  // namespace

void Threads::run(int32_t count, void* closure, Task task) {
  if (count > 1 && host_ != nullptr) {
    Loop loop = {closure, task};
    host_(user_, count, run_job, &loop);
    return;
  }
#if !defined(__wasm__)
  if (count > 1 && most_ > 1) return run_on_workers(count, closure, task);
#endif
  for (int32_t number = 0; number < count; ++number) task(closure, 0, number);
}

#if defined(__wasm__)
Threads::Threads() : most_(1) {}
Threads::~Threads() = default;
#else
Threads::Threads() : most_(std::max(int32_t(std::thread::hardware_concurrency()), 1)) {}

Threads::~Threads() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
  }
  begins_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void Threads::run_on_workers(int32_t count, void* closure, Task task) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const int32_t helpers = helpers_for(count);
    closure_ = closure, task_ = task, count_ = count;
    next_ = 0;
    helpers_ = busy_ = helpers;
    round_ += 1;
  }
  begins_.notify_all();
  take_tasks(0);
  std::unique_lock<std::mutex> lock(mutex_);
  ends_.wait(lock, [this] { return busy_ == 0; });
}

// Returns the number of helpers. If the system cannot create a thread, this number is smaller; there is no exception,
// because exceptions cannot pass through a kernel.
int32_t Threads::helpers_for(int32_t count) noexcept {
  const int32_t wanted = std::min(count, most_) - 1;
  try {
    while (int32_t(workers_.size()) < wanted) {
      workers_.emplace_back(&Threads::serve, this, int32_t(workers_.size()) + 1, round_);
    }
  } catch (const std::exception&) {
  }
  return std::min(wanted, int32_t(workers_.size()));
}

void Threads::take_tasks(int32_t thread) {
  for (int32_t number = next_++; number < count_; number = next_++) task_(closure_, thread, number);
}

void Threads::serve(int32_t thread, uint64_t done) {
  const WithUsualFloats floats;
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    begins_.wait(lock, [&] { return is_over_ || round_ != done; });
    if (is_over_) return;
    done = round_;
    if (thread > helpers_) continue;
    lock.unlock();
    take_tasks(thread);
    lock.lock();
    if (--busy_ == 0) ends_.notify_one();
  }
}
#endif

}  // namespace taichi_soft
