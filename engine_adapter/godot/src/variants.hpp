// Converts values between Godot's types and the library's types. Throws Refused for invalid values.
//
// world_native.cpp uses Godot only through this file. The type Variant and the functions below the line are implemented
// for each version in src/godot3 and src/godot4.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "taichi_soft.h"
#include "variant.hpp"

namespace taichi_soft_godot {

class Refused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

const char* const kClass = "SoftWorldNative";  // class name in scripts

enum class Type { whole, real, text, vector, transform, bytes, whole_numbers, other };

// The arguments of a call from a script.
class Arguments {
 public:
  explicit Arguments(const Variant* const* values) : values_(values) {}

  int64_t whole(int which) const;
  int32_t small(int which) const;  // a 32-bit integer
  double real(int which) const;
  std::string text(int which) const;
  void vector(int which, double out[3]) const;
  ts_pose pose(int which) const;  // from a Transform, without its scale
  std::vector<uint8_t> bytes(int which) const;
  std::vector<int32_t> whole_numbers(int which) const;

 private:
  const Variant& typed(int which, Type type) const;

  const Variant* const* values_;
};

// ---- implemented for each version of Godot ----

Type type_of(const Variant& value);
const char* type_name(Type type);  // name of the type in scripts

// Values whose type was checked before.
int64_t whole_of(const Variant& value);
double real_of(const Variant& value);
std::string text_of(const Variant& value);
void read_vector(const Variant& value, float out[3]);
void read_transform(const Variant& value, float out[12]);  // three rows of the basis, then the origin
std::vector<uint8_t> bytes_of(const Variant& value);
std::vector<int32_t> whole_numbers_of(const Variant& value);

Variant nothing();
Variant of(bool value);
Variant of(int64_t value);
Variant of(double value);
Variant of(const std::string& value);
Variant of_vector(const double vector[3]);
Variant of_transform(const float numbers[12]);  // in the order of read_transform
Variant of_bytes(const std::vector<uint8_t>& bytes);
Variant of_whole_numbers(const std::vector<int32_t>& numbers);
Variant of_pairs(const std::vector<float>& numbers);    // an array of Vector2
Variant of_triples(const std::vector<float>& numbers);  // an array of Vector3
Variant of_list(std::vector<Variant> values);           // an Array that takes ownership of the values

void show_error(const char* text, const char* method);  // in the engine's error output

}  // namespace taichi_soft_godot
