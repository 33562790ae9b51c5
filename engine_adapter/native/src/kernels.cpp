#include "kernels.hpp"

#include "error.hpp"

namespace taichi_soft {

Kernels::~Kernels() { close(); }

Kernels::Kernel Kernels::find(const std::string& name) const {
  for (const ts_linked_kernel* row = rows_ + 1; row->name != nullptr; ++row) {
    if (name == row->name) return reinterpret_cast<Kernel>(row->run);
  }
  fail(TS_ERROR_FILE, "the world file has no kernel %s: export it again", name.c_str());
}

}  // namespace taichi_soft
