// Loads and calls the machine code that `taichi-soft export` wrote for a world, from a file or linked into the game.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "taichi_soft.h"

namespace taichi_soft {

struct Runtime;

// Argument of a kernel. The layout is that of Taichi 1.7, which the machine code requires.
struct Context {
  void* arguments;  // struct of the kernel's arguments, in order
  Runtime* runtime;
  int32_t thread;
  int64_t* result;
};

using Task = void (*)(void* closure, int32_t thread, int32_t number);

struct Runtime {
  struct {
    char *begin, *end;
    int64_t size;
  } chunks[2];
  void* functions[4];
  void* unused;
  char* roots[512];  // roots of field layouts; a world file has one root
  int64_t root_sizes[512];
  void* pool;
  // Runs tasks 0 to count - 1 on any threads, and starts them in this order. Taichi's number of threads is ignored.
  void (*parallel_for)(void* pool, int32_t count, int32_t threads, void* closure, Task task);
  void* lists[3][1024];
  char* temporaries;  // values that one part of a kernel passes to the next
  void* rest[512];
};

class Kernels {
 public:
  using Kernel = void (*)(Context* context);

  // Loads the file for this platform from a folder. Fails if there is no such file, or if its length or checksum
  // differs from the exported file.
  Kernels(const std::string& folder, const std::vector<std::string>& files, const std::vector<int64_t>& sums);
  // Uses kernels that are linked into the game.
  explicit Kernels(const ts_linked_kernel* rows) : rows_(rows) {}
  ~Kernels();
  Kernels(const Kernels&) = delete;
  Kernels& operator=(const Kernels&) = delete;

  // Text that identifies the export that made the kernels.
  const char* stamp() const { return rows_->name; }
  Kernel find(const std::string& name) const;

 private:
  void close();

  void* library_ = nullptr;
  const ts_linked_kernel* rows_ = nullptr;  // the name of the first row is the stamp; the last row is null
};

}  // namespace taichi_soft
