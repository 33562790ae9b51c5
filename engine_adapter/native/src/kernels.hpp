// The machine code of a world, which `taichi-soft export` compiled its kernels to: in a file that is opened here, or
// linked into the game. And how it is called.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "taichi_soft.h"

namespace taichi_soft {

struct Runtime;

// As Taichi 1.7 lays them out in the kernels' code.
struct Context {
  void* arguments;  // a struct of them, in their order
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
  char* roots[512];  // of layouts of fields: a world file has one
  int64_t root_sizes[512];
  void* pool;
  // Runs tasks 0 to count - 1, in any threads, begun in this order. How many threads Taichi would take is of no interest.
  void (*parallel_for)(void* pool, int32_t count, int32_t threads, void* closure, Task task);
  void* lists[3][1024];
  char* temporaries;  // what one part of a kernel leaves for the next
  void* rest[512];
};

class Kernels {
 public:
  using Kernel = void (*)(Context* context);

  // The file of this platform among those in a folder. Fails where there is none, or where it is not the one that was
  // exported, whose length and checksum are given for each.
  Kernels(const std::string& folder, const std::vector<std::string>& files, const std::vector<int64_t>& sums);
  // Those that a game is linked with.
  explicit Kernels(const ts_linked_kernel* rows) : rows_(rows) {}
  ~Kernels();
  Kernels(const Kernels&) = delete;
  Kernels& operator=(const Kernels&) = delete;

  // By which the export is known that made them.
  const char* stamp() const { return rows_->name; }
  Kernel find(const std::string& name) const;

 private:
  void close();

  void* library_ = nullptr;
  const ts_linked_kernel* rows_ = nullptr;  // the first has the stamp for a name, the last has none
};

}  // namespace taichi_soft
