// Godot 3: its functions, and its type for any value.
#pragma once

#include <gdnative_api_struct.gen.h>

namespace taichi_soft_godot {

using Variant = godot_variant;

extern const godot_gdnative_core_api_struct* api;  // from when the library is loaded

}  // namespace taichi_soft_godot
