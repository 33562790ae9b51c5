#include "machine.hpp"

#include <cstring>

#include "scene.hpp"

namespace taichi_soft {

namespace {

constexpr size_t kLine = 64;             // cache line [bytes], the alignment of fields
constexpr size_t kTemporaries = 1 << 16;  // more than any kernel needs

void run_on_threads(void* pool, int32_t count, int32_t, void* closure, Task task) {
  static_cast<Threads*>(pool)->run(count, closure, task);
}

template <typename Number>
void pack(std::vector<char>* packed, Number number) {
  const size_t at = (packed->size() + sizeof number - 1) / sizeof number * sizeof number;
  packed->resize(at + sizeof number);
  std::memcpy(packed->data() + at, &number, sizeof number);
}

}  // namespace

Machine::Machine(const Scene& scene) : scene_(scene), runtime_(std::make_unique<Runtime>()) {
  const auto image = scene.archive.get<unsigned char>("fields/image");
  fields_.resize(image.count + 2 * kLine);
  const size_t beyond = reinterpret_cast<uintptr_t>(fields_.data()) % kLine;
  root_ = fields_.data() + (kLine - beyond) % kLine;
  std::memcpy(root_, image.data, image.count);
  temporaries_.resize(kTemporaries);
  for (char*& root : runtime_->roots) root = root_;
  runtime_->temporaries = temporaries_.data();
  runtime_->pool = &threads;
  runtime_->parallel_for = run_on_threads;
}

float Machine::launch(const char* kernel, const std::vector<Argument>& arguments) {
  packed_.clear();
  for (const Argument& each : arguments) {
    if (each.kind == Argument::kWhole) pack(&packed_, each.whole);
    if (each.kind == Argument::kReal) pack(&packed_, each.real);
    if (each.kind == Argument::kArray) {
      // An array is a struct, which has the alignment of a pointer.
      packed_.resize((packed_.size() + sizeof(void*) - 1) / sizeof(void*) * sizeof(void*));
      pack(&packed_, each.rows);
      if (each.width > 0) pack(&packed_, each.width);
      pack(&packed_, each.data);
    }
  }
  packed_.resize(packed_.size() + sizeof(void*));
  int64_t result[8] = {};
  Context context = {packed_.data(), runtime_.get(), 0, result};
  scene_.kernel(kernel)(&context);
  float number;
  std::memcpy(&number, result, sizeof number);
  return number;
}

}  // namespace taichi_soft
