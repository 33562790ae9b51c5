#include "threads.hpp"

#include "floats.hpp"

namespace taichi_soft {

Threads::~Threads() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
  }
  begins_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void Threads::run(int32_t count, void* closure, Task task) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    while (int32_t(workers_.size()) < count - 1) {
      workers_.emplace_back(&Threads::serve, this, int32_t(workers_.size()) + 1, round_);
    }
    closure_ = closure, task_ = task, count_ = count;
    next_ = 0;
    busy_ = int32_t(workers_.size());
    round_ += 1;
  }
  begins_.notify_all();
  take_tasks(0);
  std::unique_lock<std::mutex> lock(mutex_);
  ends_.wait(lock, [this] { return busy_ == 0; });
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
    lock.unlock();
    take_tasks(thread);
    lock.lock();
    if (--busy_ == 0) ends_.notify_one();
  }
}

}  // namespace taichi_soft
