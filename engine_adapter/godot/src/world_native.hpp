// The class SoftWorldNative of scripts: a world file and one world of it.
#pragma once

#include <string>
#include <vector>

#include "variants.hpp"

namespace taichi_soft_godot {

struct WorldNative {
  ts_scene scene = 0;  // 0 until `load`
  ts_world world = 0;
  std::string last_error;
  std::vector<float> positions, normals;  // kept, so that a frame allocates less
  std::vector<ts_event> events;           // likewise

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

// A refused call returns null, shows its text among Godot's errors, and keeps it for `last_error`.
Variant call(WorldNative& self, const Method& method, int count, const Variant* const* values);

}  // namespace taichi_soft_godot
