// Functions and Variant of Godot 3.
#pragma once

#include <gdnative_api_struct.gen.h>

namespace taichi_soft_godot {

using Variant = godot_variant;

extern const godot_gdnative_core_api_struct* api;  // set when the library is loaded

}  // namespace taichi_soft_godot
