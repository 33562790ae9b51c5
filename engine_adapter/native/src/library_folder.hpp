// Where this library lies, with Taichi's runtime beside it.
#pragma once

namespace taichi_soft {

// Tell Taichi to read its bitcode there; a folder that TI_LIB_DIR names already is left alone.
void use_runtime_beside_library();

}  // namespace taichi_soft
