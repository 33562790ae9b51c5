#include "../variants.hpp"

#include <cstdio>
#include <cstring>

namespace taichi_soft_godot {

Functions godot;
TypeFunctions types[GDEXTENSION_VARIANT_TYPE_VARIANT_MAX];

namespace {

constexpr auto kBool = GDEXTENSION_VARIANT_TYPE_BOOL, kInt = GDEXTENSION_VARIANT_TYPE_INT,
               kFloat = GDEXTENSION_VARIANT_TYPE_FLOAT, kString = GDEXTENSION_VARIANT_TYPE_STRING,
               kStringName = GDEXTENSION_VARIANT_TYPE_STRING_NAME, kVector3 = GDEXTENSION_VARIANT_TYPE_VECTOR3,
               kTransform = GDEXTENSION_VARIANT_TYPE_TRANSFORM3D, kArray = GDEXTENSION_VARIANT_TYPE_ARRAY,
               kBytes = GDEXTENSION_VARIANT_TYPE_PACKED_BYTE_ARRAY,
               kInts = GDEXTENSION_VARIANT_TYPE_PACKED_INT32_ARRAY,
               kVectors2 = GDEXTENSION_VARIANT_TYPE_PACKED_VECTOR2_ARRAY,
               kVectors3 = GDEXTENSION_VARIANT_TYPE_PACKED_VECTOR3_ARRAY;

// Indices of constructors, from extension_api.json. Methods are found by the hash of their signature.
constexpr int kEmpty = 0, kOfString = 2, kOfStringName = 2, kOfParts = 3;
constexpr GDExtensionInt kHashOfResize = 848867239, kHashOfSize = 3173160232;

template <typename Function>
Function present(Function function, const std::string& name) {
  if (function == nullptr) throw Refused("this Godot lacks " + name + ", which 4.1 to 4.4 have");
  return function;
}

void find_types() {
  for (const auto type : {kBool, kInt, kFloat, kString, kStringName, kVector3, kTransform, kArray, kBytes, kInts,
                          kVectors2, kVectors3}) {
    const std::string name = "conversion of type " + std::to_string(int(type));
    types[type].to_variant = present(godot.get_variant_from_type_constructor(type), name);
    types[type].from_variant = present(godot.get_variant_to_type_constructor(type), name);
  }
  for (const auto type : {kString, kStringName, kArray, kBytes, kInts, kVectors2, kVectors3}) {
    const std::string of_type = " of type " + std::to_string(int(type));
    const int which = type == kString ? kOfStringName : type == kStringName ? kOfString : kEmpty;
    types[type].make = present(godot.variant_get_ptr_constructor(type, which), "constructor" + of_type);
    types[type].destroy = present(godot.variant_get_ptr_destructor(type), "destructor" + of_type);
  }
  const Name resize("resize"), size("size");
  for (const auto type : {kArray, kBytes, kInts, kVectors2, kVectors3}) {
    const std::string of_type = " of type " + std::to_string(int(type));
    types[type].resize =
        present(godot.variant_get_ptr_builtin_method(type, resize.address(), kHashOfResize), "resize" + of_type);
    types[type].size =
        present(godot.variant_get_ptr_builtin_method(type, size.address(), kHashOfSize), "size" + of_type);
  }
}

// Throws Refused in a Godot with double precision, in which Variant and all vectors are larger.
void require_single_precision() {
  const double parts[] = {1.0, 2.0, 3.0};
  const GDExtensionConstTypePtr arguments[] = {Address(&parts[0]), Address(&parts[1]), Address(&parts[2])};
  double memory[3] = {};
  float first = 0.0f;
  present(godot.variant_get_ptr_constructor(kVector3, kOfParts), "constructor of Vector3")(Address(memory), arguments);
  std::memcpy(&first, memory, sizeof first);
  if (first != 1.0f) throw Refused("this Godot is built with double precision: use one with single precision");
}

template <GDExtensionVariantType type>
Variant of_type(const void* value) {
  Variant found;
  types[type].to_variant(Address(&found), Address(value));
  return found;
}

template <GDExtensionVariantType type>
void read(const Variant& value, void* out) {
  types[type].from_variant(Address(out), Address(&value));
}

template <GDExtensionVariantType type>
void resize(const Held<type>& array, size_t count) {
  const int64_t wanted = int64_t(count);
  const GDExtensionConstTypePtr arguments[] = {Address(&wanted)};
  int64_t code = 0;
  types[type].resize(array.address(), arguments, Address(&code), 1);
  if (code != 0) throw Refused("Godot cannot allocate " + std::to_string(count) + " values");
}

// Makes and fills an array of Godot. `index` returns the address of its first value.
template <GDExtensionVariantType type, typename Number, typename Index>
Variant filled(const std::vector<Number>& numbers, size_t numbers_per_value, Index index) {
  Held<type> array;
  types[type].make(array.address(), nullptr);
  if (!numbers.empty()) {
    resize(array, numbers.size() / numbers_per_value);
    std::memcpy(static_cast<void*>(index(array.address(), 0)), numbers.data(), numbers.size() * sizeof(Number));
  }
  return of_type<type>(array.address());
}

// Reads an array of Godot. `index` returns the address of its first value.
template <GDExtensionVariantType type, typename Number, typename Index>
std::vector<Number> taken(const Variant& value, Index index) {
  Held<type> array;
  read<type>(value, array.address());
  int64_t size = 0;
  types[type].size(array.address(), nullptr, Address(&size), 0);
  std::vector<Number> found(static_cast<size_t>(size));
  if (size > 0) std::memcpy(found.data(), index(array.address(), 0), found.size() * sizeof(Number));
  return found;
}

}  // namespace

void find_functions(GDExtensionInterfaceGetProcAddress get_proc_address) {
  // Godot 4.0 passes a table instead of the function; the table begins with its version.
  uint32_t version[2];
  std::memcpy(version, reinterpret_cast<const void*>(get_proc_address), sizeof version);
  if (version[0] == 4 && version[1] == 0) throw Refused("this is Godot 4.0: use 4.1 or later");
#define FOUND(type, name) \
  godot.name = present(reinterpret_cast<GDExtensionInterface##type>(get_proc_address(#name)), "function " #name);
  FUNCTIONS_OF_GODOT(FOUND)
#undef FOUND
  require_single_precision();
  find_types();
}

Type type_of(const Variant& value) {
  switch (godot.variant_get_type(Address(&value))) {
    case kInt: return Type::whole;
    case kFloat: return Type::real;
    case kString: return Type::text;
    case kStringName: return Type::text;
    case kVector3: return Type::vector;
    case kTransform: return Type::transform;
    case kBytes: return Type::bytes;
    case kInts: return Type::whole_numbers;
    default: return Type::other;
  }
}

const char* type_name(Type type) {
  const char* const names[] = {"whole number", "number",          "String",           "Vector3",
                               "Transform3D",  "PackedByteArray", "PackedInt32Array", "value"};
  return names[int(type)];
}

int64_t whole_of(const Variant& value) {
  int64_t found = 0;
  read<kInt>(value, &found);
  return found;
}

double real_of(const Variant& value) {
  double found = 0.0;
  read<kFloat>(value, &found);
  return found;
}

std::string text_of(const Variant& value) {
  Held<kString> string;
  if (godot.variant_get_type(Address(&value)) == kStringName) {
    Held<kStringName> name;
    read<kStringName>(value, name.address());
    const GDExtensionConstTypePtr arguments[] = {name.address()};
    types[kString].make(string.address(), arguments);
  } else {
    read<kString>(value, string.address());
  }
  std::string found(size_t(godot.string_to_utf8_chars(string.address(), nullptr, 0)), '\0');
  godot.string_to_utf8_chars(string.address(), found.data(), GDExtensionInt(found.size()));
  return found;
}

void read_vector(const Variant& value, float out[3]) { read<kVector3>(value, out); }

void read_transform(const Variant& value, float out[12]) { read<kTransform>(value, out); }

std::vector<uint8_t> bytes_of(const Variant& value) {
  return taken<kBytes, uint8_t>(value, godot.packed_byte_array_operator_index_const);
}

std::vector<int32_t> whole_numbers_of(const Variant& value) {
  return taken<kInts, int32_t>(value, godot.packed_int32_array_operator_index_const);
}

Variant nothing() {
  Variant found;
  godot.variant_new_nil(Address(&found));
  return found;
}

Variant of(bool value) {
  const GDExtensionBool plain = value;
  return of_type<kBool>(&plain);
}

Variant of(int64_t value) { return of_type<kInt>(&value); }

Variant of(double value) { return of_type<kFloat>(&value); }

Variant of(const std::string& value) { return of_type<kString>(String(value.c_str()).address()); }

Variant of_vector(const double vector[3]) {
  const float plain[] = {float(vector[0]), float(vector[1]), float(vector[2])};
  return of_type<kVector3>(plain);
}

Variant of_transform(const float numbers[12]) { return of_type<kTransform>(numbers); }

Variant of_bytes(const std::vector<uint8_t>& bytes) {
  return filled<kBytes>(bytes, 1, godot.packed_byte_array_operator_index);
}

Variant of_whole_numbers(const std::vector<int32_t>& numbers) {
  return filled<kInts>(numbers, 1, godot.packed_int32_array_operator_index);
}

Variant of_pairs(const std::vector<float>& numbers) {
  return filled<kVectors2>(numbers, 2, godot.packed_vector2_array_operator_index);
}

Variant of_triples(const std::vector<float>& numbers) {
  return filled<kVectors3>(numbers, 3, godot.packed_vector3_array_operator_index);
}

Variant of_list(std::vector<Variant> values) {
  Held<kArray> array;
  types[kArray].make(array.address(), nullptr);
  resize(array, values.size());
  for (size_t i = 0; i < values.size(); ++i) {  // the old values are nil and need no destructor
    std::memcpy(static_cast<void*>(godot.array_operator_index(array.address(), GDExtensionInt(i))), &values[i],
                sizeof values[i]);
  }
  return of_type<kArray>(array.address());
}

void show_error(const char* text, const char* method) {
  if (godot.print_error != nullptr) {
    godot.print_error(text, method, kClass, 0, false);
  } else {
    std::fprintf(stderr, "%s: %s\n", method, text);
  }
}

}  // namespace taichi_soft_godot
