// Locks between threads. WebAssembly has only one thread and needs no locks.
#pragma once

#if !defined(__wasm__)
#include <mutex>
#include <thread>
#endif

namespace taichi_soft {

#if defined(__wasm__)
class Mutex {};

class Guard {
 public:
  explicit Guard(Mutex&) {}
};

class Attempt {  // tries to lock without waiting
 public:
  explicit Attempt(Mutex&) {}
  bool has_succeeded() const { return true; }
};

using ThreadId = int;  // 0 means no thread
inline ThreadId this_thread() { return 1; }
#else
using Mutex = std::mutex;
using Guard = std::lock_guard<std::mutex>;

class Attempt {
 public:
  explicit Attempt(Mutex& mutex) : lock_(mutex, std::try_to_lock) {}
  bool has_succeeded() const { return lock_.owns_lock(); }

 private:
  std::unique_lock<std::mutex> lock_;
};

using ThreadId = std::thread::id;
inline ThreadId this_thread() { return std::this_thread::get_id(); }
#endif

}  // namespace taichi_soft
