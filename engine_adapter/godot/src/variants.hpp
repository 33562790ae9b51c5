// Values of Godot to those of the library and back. What does not fit is thrown as an error with a text.
#pragma once

#include <gdnative_api_struct.gen.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "taichi_soft.h"

namespace taichi_soft_godot {

extern const godot_gdnative_core_api_struct* api;  // Godot's functions, from when the library is loaded

class Refused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The arguments of a call from a script.
class Arguments {
 public:
  Arguments(int count, godot_variant** values) : count_(count), values_(values) {}

  int count() const { return count_; }
  int64_t whole(int which) const;
  int32_t small(int which) const;  // a whole number of 32 bits
  double real(int which) const;
  std::string text(int which) const;
  void vector(int which, double out[3]) const;
  ts_pose pose(int which) const;  // of a Transform; its scale is left out
  std::vector<uint8_t> bytes(int which) const;

 private:
  const godot_variant* typed(int which, godot_variant_type type, const char* name) const;

  int count_;
  godot_variant** values_;
};

godot_variant nothing();
godot_variant of(bool value);
godot_variant of(int64_t value);
godot_variant of(double value);
godot_variant of(const std::string& value);
godot_variant of_vector(const double vector[3]);
godot_variant of_bytes(const std::vector<uint8_t>& bytes);
godot_variant of_whole_numbers(const std::vector<int32_t>& numbers);
godot_variant of_pairs(const std::vector<float>& numbers);    // PoolVector2Array
godot_variant of_triples(const std::vector<float>& numbers);  // PoolVector3Array
godot_variant of_list(std::vector<godot_variant> values);     // Array; takes the values over

}  // namespace taichi_soft_godot
