#include "variants.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace taichi_soft_godot {

const godot_gdnative_core_api_struct* api = nullptr;

const godot_variant* Arguments::typed(int which, godot_variant_type type, const char* name) const {
  if (api->godot_variant_get_type(values_[which]) != type) {
    throw Refused("argument " + std::to_string(which + 1) + " is no " + name);
  }
  return values_[which];
}

int64_t Arguments::whole(int which) const {
  return api->godot_variant_as_int(typed(which, GODOT_VARIANT_TYPE_INT, "whole number"));
}

int32_t Arguments::small(int which) const {
  const int64_t found = whole(which);
  if (found < std::numeric_limits<int32_t>::min() || found > std::numeric_limits<int32_t>::max()) {
    throw Refused("argument " + std::to_string(which + 1) + " is " + std::to_string(found) + ": too large");
  }
  return int32_t(found);
}

double Arguments::real(int which) const {
  if (api->godot_variant_get_type(values_[which]) == GODOT_VARIANT_TYPE_INT) return double(whole(which));
  return api->godot_variant_as_real(typed(which, GODOT_VARIANT_TYPE_REAL, "number"));
}

std::string Arguments::text(int which) const {
  godot_string string = api->godot_variant_as_string(typed(which, GODOT_VARIANT_TYPE_STRING, "String"));
  godot_char_string bytes = api->godot_string_utf8(&string);
  std::string found = api->godot_char_string_get_data(&bytes);
  api->godot_char_string_destroy(&bytes);
  api->godot_string_destroy(&string);
  return found;
}

void Arguments::vector(int which, double out[3]) const {
  const godot_vector3 found = api->godot_variant_as_vector3(typed(which, GODOT_VARIANT_TYPE_VECTOR3, "Vector3"));
  float numbers[3];
  static_assert(sizeof found == sizeof numbers);
  std::memcpy(numbers, &found, sizeof numbers);
  std::copy(numbers, numbers + 3, out);
}

ts_pose Arguments::pose(int which) const {
  const godot_transform found =
      api->godot_variant_as_transform(typed(which, GODOT_VARIANT_TYPE_TRANSFORM, "Transform"));
  float numbers[12];  // three rows of the basis, then the origin
  static_assert(sizeof found == sizeof numbers);
  std::memcpy(numbers, &found, sizeof numbers);
  double m[3][3];
  for (int c = 0; c < 3; ++c) {
    const double length = std::hypot(numbers[c], numbers[3 + c], numbers[6 + c]);
    if (!(length > 1e-6)) throw Refused("argument " + std::to_string(which + 1) + " is a Transform without size");
    for (int r = 0; r < 3; ++r) m[r][c] = numbers[3 * r + c] / length;
  }
  const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  if (!(std::fabs(determinant - 1.0) < 1e-3)) {
    throw Refused("argument " + std::to_string(which + 1) + " is a Transform that mirrors, shears or is not finite");
  }
  ts_pose pose;
  std::copy(numbers + 9, numbers + 12, pose.position);
  // The largest part of the quaternion first: the others are divided by it.
  const double trace = m[0][0] + m[1][1] + m[2][2];
  double* q = pose.rotation;
  if (trace > 0.0) {
    const double s = 2.0 * std::sqrt(trace + 1.0);
    q[0] = (m[2][1] - m[1][2]) / s, q[1] = (m[0][2] - m[2][0]) / s, q[2] = (m[1][0] - m[0][1]) / s, q[3] = s / 4.0;
  } else {
    const int i = m[0][0] >= m[1][1] && m[0][0] >= m[2][2] ? 0 : (m[1][1] >= m[2][2] ? 1 : 2);
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2.0 * std::sqrt(1.0 + m[i][i] - m[j][j] - m[k][k]);
    q[i] = s / 4.0, q[j] = (m[j][i] + m[i][j]) / s, q[k] = (m[k][i] + m[i][k]) / s, q[3] = (m[k][j] - m[j][k]) / s;
  }
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; ++i) q[i] /= length;
  return pose;
}

std::vector<uint8_t> Arguments::bytes(int which) const {
  godot_pool_byte_array array =
      api->godot_variant_as_pool_byte_array(typed(which, GODOT_VARIANT_TYPE_POOL_BYTE_ARRAY, "PoolByteArray"));
  godot_pool_byte_array_read_access* read = api->godot_pool_byte_array_read(&array);
  const uint8_t* first = api->godot_pool_byte_array_read_access_ptr(read);
  std::vector<uint8_t> found;
  const size_t size = size_t(api->godot_pool_byte_array_size(&array));
  if (size > 0) found.assign(first, first + size);
  api->godot_pool_byte_array_read_access_destroy(read);
  api->godot_pool_byte_array_destroy(&array);
  return found;
}

godot_variant nothing() {
  godot_variant found;
  api->godot_variant_new_nil(&found);
  return found;
}

godot_variant of(bool value) {
  godot_variant found;
  api->godot_variant_new_bool(&found, value);
  return found;
}

godot_variant of(int64_t value) {
  godot_variant found;
  api->godot_variant_new_int(&found, value);
  return found;
}

godot_variant of(double value) {
  godot_variant found;
  api->godot_variant_new_real(&found, value);
  return found;
}

godot_variant of(const std::string& value) {
  godot_string string = api->godot_string_chars_to_utf8(value.c_str());
  godot_variant found;
  api->godot_variant_new_string(&found, &string);
  api->godot_string_destroy(&string);
  return found;
}

godot_variant of_vector(const double vector[3]) {
  godot_vector3 plain;
  api->godot_vector3_new(&plain, float(vector[0]), float(vector[1]), float(vector[2]));
  godot_variant found;
  api->godot_variant_new_vector3(&found, &plain);
  return found;
}

// A pool array of Godot, filled at once: the functions of each kind differ by name only.
#define FILLED(kind, count, values)                                                      \
  godot_pool_##kind##_array array;                                                       \
  api->godot_pool_##kind##_array_new(&array);                                            \
  api->godot_pool_##kind##_array_resize(&array, int(count));                             \
  if ((count) > 0) {                                                                     \
    auto* write = api->godot_pool_##kind##_array_write(&array);                          \
    std::memcpy(static_cast<void*>(api->godot_pool_##kind##_array_write_access_ptr(write)), (values).data(), \
                (values).size() * sizeof((values)[0]));                                      \
    api->godot_pool_##kind##_array_write_access_destroy(write);                          \
  }                                                                                      \
  godot_variant found;                                                                   \
  api->godot_variant_new_pool_##kind##_array(&found, &array);                            \
  api->godot_pool_##kind##_array_destroy(&array);                                        \
  return found

godot_variant of_bytes(const std::vector<uint8_t>& bytes) { FILLED(byte, bytes.size(), bytes); }
godot_variant of_whole_numbers(const std::vector<int32_t>& numbers) { FILLED(int, numbers.size(), numbers); }
godot_variant of_pairs(const std::vector<float>& numbers) { FILLED(vector2, numbers.size() / 2, numbers); }
godot_variant of_triples(const std::vector<float>& numbers) { FILLED(vector3, numbers.size() / 3, numbers); }

godot_variant of_list(std::vector<godot_variant> values) {
  godot_array array;
  api->godot_array_new(&array);
  for (godot_variant& value : values) {
    api->godot_array_append(&array, &value);
    api->godot_variant_destroy(&value);
  }
  godot_variant found;
  api->godot_variant_new_array(&found, &array);
  api->godot_array_destroy(&array);
  return found;
}

}  // namespace taichi_soft_godot
