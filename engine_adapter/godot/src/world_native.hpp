// The script class SoftWorldNative: a world file and one world.
#pragma once

#include <string>
#include <vector>

#include "variants.hpp"

namespace taichi_soft_godot {

struct WorldNative {
  ts_scene scene = 0;  // 0 until `load`
  ts_world world = 0;
  std::string last_error;
  std::vector<float> positions, normals;  // reused between frames to avoid allocations
  std::vector<ts_event> events;           // reused between frames to avoid allocations

  WorldNative() = default;
  WorldNative(const WorldNative&) = delete;
  WorldNative& operator=(const WorldNative&) = delete;
  ~WorldNative() { clear(); }
  void clear();
};

struct Method {
  const char* name;
  int argument_count;
  Variant (*call)(WorldNative& self, const Arguments& arguments);
};

extern const std::vector<Method> methods;

// Calls a method. A refused call returns null, prints an error text to Godot's error output, and stores the text for
// `last_error`.
Variant call(WorldNative& self, const Method& method, int count, const Variant* const* values);

}  // namespace taichi_soft_godot
