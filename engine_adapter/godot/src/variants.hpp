// Values of Godot to those of the library and back. What does not fit is thrown as an error with a text.
//
// This is all that world_native.cpp knows of Godot. The type Variant and the functions below the line are written
// once for each engine: src/godot3 and src/godot4.
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

const char* const kClass = "SoftWorldNative";  // its name in scripts

enum class Type { whole, real, text, vector, transform, bytes, whole_numbers, other };

// The arguments of a call from a script.
class Arguments {
 public:
  explicit Arguments(const Variant* const* values) : values_(values) {}

  int64_t whole(int which) const;
  int32_t small(int which) const;  // a whole number of 32 bits
  double real(int which) const;
  std::string text(int which) const;
  void vector(int which, double out[3]) const;
  ts_pose pose(int which) const;  // of a Transform; its scale is left out
  std::vector<uint8_t> bytes(int which) const;
  std::vector<int32_t> whole_numbers(int which) const;

 private:
  const Variant& typed(int which, Type type) const;

  const Variant* const* values_;
};

// ---- of each engine ----

Type type_of(const Variant& value);
const char* type_name(Type type);  // as its scripts call it

// Of a value whose type was looked at before.
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
Variant of_transform(const float numbers[12]);  // as read_transform has them
Variant of_bytes(const std::vector<uint8_t>& bytes);
Variant of_whole_numbers(const std::vector<int32_t>& numbers);
Variant of_pairs(const std::vector<float>& numbers);    // an array of Vector2
Variant of_triples(const std::vector<float>& numbers);  // an array of Vector3
Variant of_list(std::vector<Variant> values);           // an Array; takes the values over

void show_error(const char* text, const char* method);  // among the engine's errors

}  // namespace taichi_soft_godot
