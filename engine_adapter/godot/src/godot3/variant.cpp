#include "../variants.hpp"

#include <cstring>

namespace taichi_soft_godot {

const godot_gdnative_core_api_struct* api = nullptr;

Type type_of(const Variant& value) {
  switch (api->godot_variant_get_type(&value)) {
    case GODOT_VARIANT_TYPE_INT: return Type::whole;
    case GODOT_VARIANT_TYPE_REAL: return Type::real;
    case GODOT_VARIANT_TYPE_STRING: return Type::text;
    case GODOT_VARIANT_TYPE_VECTOR3: return Type::vector;
    case GODOT_VARIANT_TYPE_TRANSFORM: return Type::transform;
    case GODOT_VARIANT_TYPE_POOL_BYTE_ARRAY: return Type::bytes;
    case GODOT_VARIANT_TYPE_POOL_INT_ARRAY: return Type::whole_numbers;
    default: return Type::other;
  }
}

const char* type_name(Type type) {
  const char* const names[] = {"whole number", "number",        "String",       "Vector3",
                               "Transform",    "PoolByteArray", "PoolIntArray", "value"};
  return names[int(type)];
}

int64_t whole_of(const Variant& value) { return api->godot_variant_as_int(&value); }

double real_of(const Variant& value) { return api->godot_variant_as_real(&value); }

std::string text_of(const Variant& value) {
  godot_string string = api->godot_variant_as_string(&value);
  godot_char_string bytes = api->godot_string_utf8(&string);
  std::string found = api->godot_char_string_get_data(&bytes);
  api->godot_char_string_destroy(&bytes);
  api->godot_string_destroy(&string);
  return found;
}

void read_vector(const Variant& value, float out[3]) {
  const godot_vector3 found = api->godot_variant_as_vector3(&value);
  static_assert(sizeof found == 3 * sizeof(float));
  std::memcpy(out, &found, sizeof found);
}

void read_transform(const Variant& value, float out[12]) {
  const godot_transform found = api->godot_variant_as_transform(&value);
  static_assert(sizeof found == 12 * sizeof(float));
  std::memcpy(out, &found, sizeof found);
}

// Reads a pool array of Godot. The functions for different kinds of arrays differ only in name.
#define TAKEN(kind, Number)                                                                    \
  godot_pool_##kind##_array array = api->godot_variant_as_pool_##kind##_array(&value);         \
  auto* read = api->godot_pool_##kind##_array_read(&array);                                    \
  const Number* first = api->godot_pool_##kind##_array_read_access_ptr(read);                  \
  const size_t size = size_t(api->godot_pool_##kind##_array_size(&array));                     \
  std::vector<Number> found;                                                                   \
  if (size > 0) found.assign(first, first + size);                                             \
  api->godot_pool_##kind##_array_read_access_destroy(read);                                    \
  api->godot_pool_##kind##_array_destroy(&array);                                              \
  return found

std::vector<uint8_t> bytes_of(const Variant& value) { TAKEN(byte, uint8_t); }
std::vector<int32_t> whole_numbers_of(const Variant& value) { TAKEN(int, int32_t); }

Variant nothing() {
  Variant found;
  api->godot_variant_new_nil(&found);
  return found;
}

Variant of(bool value) {
  Variant found;
  api->godot_variant_new_bool(&found, value);
  return found;
}

Variant of(int64_t value) {
  Variant found;
  api->godot_variant_new_int(&found, value);
  return found;
}

Variant of(double value) {
  Variant found;
  api->godot_variant_new_real(&found, value);
  return found;
}

Variant of(const std::string& value) {
  godot_string string = api->godot_string_chars_to_utf8(value.c_str());
  Variant found;
  api->godot_variant_new_string(&found, &string);
  api->godot_string_destroy(&string);
  return found;
}

Variant of_vector(const double vector[3]) {
  godot_vector3 plain;
  api->godot_vector3_new(&plain, float(vector[0]), float(vector[1]), float(vector[2]));
  Variant found;
  api->godot_variant_new_vector3(&found, &plain);
  return found;
}

Variant of_transform(const float numbers[12]) {
  godot_transform plain;
  static_assert(sizeof plain == 12 * sizeof(float));
  std::memcpy(static_cast<void*>(&plain), numbers, sizeof plain);
  Variant found;
  api->godot_variant_new_transform(&found, &plain);
  return found;
}

// Makes and fills a pool array of Godot.
#define FILLED(kind, count, values)                                                                          \
  godot_pool_##kind##_array array;                                                                           \
  api->godot_pool_##kind##_array_new(&array);                                                                \
  api->godot_pool_##kind##_array_resize(&array, int(count));                                                 \
  if ((count) > 0) {                                                                                         \
    auto* write = api->godot_pool_##kind##_array_write(&array);                                              \
    std::memcpy(static_cast<void*>(api->godot_pool_##kind##_array_write_access_ptr(write)), (values).data(), \
                (values).size() * sizeof((values)[0]));                                                      \
    api->godot_pool_##kind##_array_write_access_destroy(write);                                              \
  }                                                                                                          \
  Variant found;                                                                                             \
  api->godot_variant_new_pool_##kind##_array(&found, &array);                                                \
  api->godot_pool_##kind##_array_destroy(&array);                                                            \
  return found

Variant of_bytes(const std::vector<uint8_t>& bytes) { FILLED(byte, bytes.size(), bytes); }
Variant of_whole_numbers(const std::vector<int32_t>& numbers) { FILLED(int, numbers.size(), numbers); }
Variant of_pairs(const std::vector<float>& numbers) { FILLED(vector2, numbers.size() / 2, numbers); }
Variant of_triples(const std::vector<float>& numbers) { FILLED(vector3, numbers.size() / 3, numbers); }

Variant of_list(std::vector<Variant> values) {
  godot_array array;
  api->godot_array_new(&array);
  for (Variant& value : values) {
    api->godot_array_append(&array, &value);
    api->godot_variant_destroy(&value);
  }
  Variant found;
  api->godot_variant_new_array(&found, &array);
  api->godot_array_destroy(&array);
  return found;
}

void show_error(const char* text, const char* method) { api->godot_print_error(text, method, kClass, 0); }

}  // namespace taichi_soft_godot
