// Functions and Variant of Godot 4.
#pragma once

#include <gdextension_interface.h>

namespace taichi_soft_godot {

// Size of a Variant in Godot 4 with single precision (extension_api.json, builtin_class_sizes of "float_64").
struct Variant {
  alignas(8) unsigned char memory[24];
};

// All functions of Godot's interface that the library uses, by names in camel case and with underscores. Godot 4.1 and
// later versions have these functions.
#define FUNCTIONS_OF_GODOT(X)                                                     \
  X(PrintError, print_error)                                                      \
  X(VariantNewNil, variant_new_nil)                                               \
  X(VariantDestroy, variant_destroy)                                              \
  X(VariantGetType, variant_get_type)                                             \
  X(GetVariantFromTypeConstructor, get_variant_from_type_constructor)             \
  X(GetVariantToTypeConstructor, get_variant_to_type_constructor)                 \
  X(VariantGetPtrConstructor, variant_get_ptr_constructor)                        \
  X(VariantGetPtrDestructor, variant_get_ptr_destructor)                          \
  X(VariantGetPtrBuiltinMethod, variant_get_ptr_builtin_method)                   \
  X(StringNewWithUtf8Chars, string_new_with_utf8_chars)                           \
  X(StringToUtf8Chars, string_to_utf8_chars)                                      \
  X(PackedByteArrayOperatorIndex, packed_byte_array_operator_index)               \
  X(PackedByteArrayOperatorIndexConst, packed_byte_array_operator_index_const)    \
  X(PackedInt32ArrayOperatorIndex, packed_int32_array_operator_index)             \
  X(PackedInt32ArrayOperatorIndexConst, packed_int32_array_operator_index_const)  \
  X(PackedVector2ArrayOperatorIndex, packed_vector2_array_operator_index)         \
  X(PackedVector3ArrayOperatorIndex, packed_vector3_array_operator_index)         \
  X(ArrayOperatorIndex, array_operator_index)                                     \
  X(ClassdbConstructObject, classdb_construct_object)                             \
  X(ClassdbRegisterExtensionClass, classdb_register_extension_class)              \
  X(ClassdbRegisterExtensionClassMethod, classdb_register_extension_class_method) \
  X(ClassdbUnregisterExtensionClass, classdb_unregister_extension_class)          \
  X(ObjectSetInstance, object_set_instance)

struct Functions {
#define DECLARED(type, name) GDExtensionInterface##type name = nullptr;
  FUNCTIONS_OF_GODOT(DECLARED)
#undef DECLARED
};

extern Functions godot;

// Throws Refused if this Godot lacks a function or has double precision.
void find_functions(GDExtensionInterfaceGetProcAddress get_proc_address);

// The required functions of a type.
struct TypeFunctions {
  GDExtensionVariantFromTypeConstructorFunc to_variant = nullptr;
  GDExtensionTypeFromVariantConstructorFunc from_variant = nullptr;
  GDExtensionPtrConstructor make = nullptr;  // makes an empty value, or converts between String and StringName
  GDExtensionPtrDestructor destroy = nullptr;
  GDExtensionPtrBuiltInMethod resize = nullptr, size = nullptr;
};

extern TypeFunctions types[GDEXTENSION_VARIANT_TYPE_VARIANT_MAX];

// Address of a value, for each of Godot's pointer types.
class Address {
 public:
  explicit Address(const void* value) : value_(const_cast<void*>(value)) {}
  template <typename T>
  operator T*() const {
    return static_cast<T*>(value_);
  }

 private:
  void* value_;
};

// A value of an opaque Godot type. Fill it immediately after construction.
template <GDExtensionVariantType type>
class Held {
 public:
  Held() = default;
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held() { types[type].destroy(address()); }
  Address address() const { return Address(memory_); }

 private:
  alignas(8) unsigned char memory_[16] = {};  // enough for strings and arrays
};

class String : public Held<GDEXTENSION_VARIANT_TYPE_STRING> {
 public:
  explicit String(const char* text) { godot.string_new_with_utf8_chars(address(), text); }
};

class Name : public Held<GDEXTENSION_VARIANT_TYPE_STRING_NAME> {
 public:
  explicit Name(const char* text) {
    const String string(text);
    const GDExtensionConstTypePtr arguments[] = {string.address()};
    types[GDEXTENSION_VARIANT_TYPE_STRING_NAME].make(address(), arguments);
  }
};

}  // namespace taichi_soft_godot
