// A stand-in for Godot 4. It loads the library as Godot does, and calls methods that are listed on standard input.
//
//     fake_host libtaichi_soft_godot4.so [--without NAME] [--double] [--old]
//
// The program implements only the functions that the library uses, with the signatures of Godot's header. For other
// names it returns null. The program tests how the library uses Godot's interface; it does not test Godot. It reports
// values that are read as another type, used after destruction or never destroyed.
//
// Lines of the input; each value begins with a letter for its type:
//
//     new                      makes an instance, and prints its number
//     call 0 status i12345     calls a method as scripts do; `ptrcall` calls it as other libraries do
//     free 0
//     end                      unloads the library, and prints the number of remaining values
#include <dlfcn.h>
#include <gdextension_interface.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace {

using Type = GDExtensionVariantType;
constexpr Type kNil = GDEXTENSION_VARIANT_TYPE_NIL, kBool = GDEXTENSION_VARIANT_TYPE_BOOL,
               kInt = GDEXTENSION_VARIANT_TYPE_INT, kFloat = GDEXTENSION_VARIANT_TYPE_FLOAT,
               kString = GDEXTENSION_VARIANT_TYPE_STRING, kName = GDEXTENSION_VARIANT_TYPE_STRING_NAME,
               kVector3 = GDEXTENSION_VARIANT_TYPE_VECTOR3, kTransform = GDEXTENSION_VARIANT_TYPE_TRANSFORM3D,
               kArray = GDEXTENSION_VARIANT_TYPE_ARRAY, kBytes = GDEXTENSION_VARIANT_TYPE_PACKED_BYTE_ARRAY,
               kInts = GDEXTENSION_VARIANT_TYPE_PACKED_INT32_ARRAY,
               kVectors2 = GDEXTENSION_VARIANT_TYPE_PACKED_VECTOR2_ARRAY,
               kVectors3 = GDEXTENSION_VARIANT_TYPE_PACKED_VECTOR3_ARRAY;

std::string without;
bool is_double = false;

[[noreturn]] void fault(const std::string& text) {
  std::cout << "FAULT " << text << std::endl;
  std::_Exit(3);
}

// ---- values ----

struct Shared;

// Godot's Variant: 24 bytes, trivially movable.
struct Value {
  int32_t type;
  int32_t padding;
  union {
    GDExtensionBool truth;
    int64_t whole;
    double real;
    float vector[3];
    Shared* shared;
    unsigned char room[16];
  };
};
static_assert(sizeof(Value) == 24);

constexpr uint32_t kAlive = 0x600dca5e, kDead = 0xdeadbeef;

// Content of a string, an array or a Transform, which copies of the value share.
struct Shared {
  uint32_t state;
  int holders;
  Type type;
  std::string text;
  std::vector<unsigned char> bytes;
  std::vector<Value> items;
};

int alive = 0;
auto& dead = *new std::vector<Shared*>;  // kept to detect use after destruction

Shared* made(Type type) {
  ++alive;
  return new Shared{kAlive, 1, type, {}, {}, {}};
}

Shared* looked_at(Shared* shared, Type type) {
  if (shared == nullptr || shared->state != kAlive) fault("a value was used after its end");
  if (shared->type != type) fault("a value was read as another type");
  return shared;
}

void end(Value& value);

void let_go(Shared* shared, Type type) {
  if (--looked_at(shared, type)->holders > 0) return;
  for (Value& item : shared->items) end(item);
  shared->state = kDead;
  shared->bytes = {}, shared->items = {}, shared->text = {};
  dead.push_back(shared);
  --alive;
}

bool is_shared(Type type) { return type >= kString && type != kVector3; }

void end(Value& value) {
  if (is_shared(Type(value.type))) let_go(value.shared, Type(value.type));
  std::memset(&value, 0xee, sizeof value);
}

size_t size_of_one(Type type) {
  switch (type) {
    case kBytes: return 1;
    case kInts: return 4;
    case kVectors2: return 8;
    case kVectors3: return 12;
    default: fault("no array of type " + std::to_string(type));
  }
}

// Returns the pointer to a value's content. In packed arrays the pointer is the second word, in other types the first.
Shared*& held(Type type, const void* memory) {
  const size_t offset = type >= kBytes ? sizeof(void*) : 0;
  return *reinterpret_cast<Shared**>(static_cast<char*>(const_cast<void*>(memory)) + offset);
}

template <Type type>
void to_variant(GDExtensionUninitializedVariantPtr out, GDExtensionTypePtr from) {
  Value value{type, 0, {}};
  if (type == kBool) {
    std::memcpy(&value.truth, from, 1);
  } else if (type == kInt || type == kFloat) {
    std::memcpy(&value.whole, from, 8);
  } else if (type == kVector3) {
    std::memcpy(value.vector, from, 12);
  } else if (type == kTransform) {
    value.shared = made(type);
    const auto* first = reinterpret_cast<unsigned char*>(from);
    value.shared->bytes.assign(first, first + 48);
  } else {
    value.shared = looked_at(held(type, from), type);
    ++value.shared->holders;
  }
  std::memcpy(static_cast<void*>(out), &value, sizeof value);
}

template <Type type>
void from_variant(GDExtensionUninitializedTypePtr out, GDExtensionVariantPtr from) {
  const Value& value = *reinterpret_cast<Value*>(from);
  if (value.type != type) fault("a Variant was read as another type");
  if (type == kBool) {
    std::memcpy(static_cast<void*>(out), &value.truth, 1);
  } else if (type == kInt || type == kFloat) {
    std::memcpy(static_cast<void*>(out), &value.whole, 8);
  } else if (type == kVector3) {
    std::memcpy(static_cast<void*>(out), value.vector, 12);
  } else if (type == kTransform) {
    std::memcpy(static_cast<void*>(out), looked_at(value.shared, type)->bytes.data(), 48);
  } else {
    ++looked_at(value.shared, type)->holders;
    held(type, out) = value.shared;
  }
}

#define EACH_TYPE(X)                                                                   \
  X(kBool) X(kInt) X(kFloat) X(kString) X(kName) X(kVector3) X(kTransform) X(kArray) \
  X(kBytes) X(kInts) X(kVectors2) X(kVectors3)

GDExtensionVariantFromTypeConstructorFunc get_variant_from_type_constructor(Type type) {
#define CASE(known) \
  if (type == known) return to_variant<known>;
  EACH_TYPE(CASE)
#undef CASE
  return nullptr;
}

GDExtensionTypeFromVariantConstructorFunc get_variant_to_type_constructor(Type type) {
#define CASE(known) \
  if (type == known) return from_variant<known>;
  EACH_TYPE(CASE)
#undef CASE
  return nullptr;
}

template <Type type>
void make_empty(GDExtensionUninitializedTypePtr out, const GDExtensionConstTypePtr*) {
  held(type, out) = made(type);
}

template <Type type, Type other>
void make_text(GDExtensionUninitializedTypePtr out, const GDExtensionConstTypePtr* arguments) {
  Shared* text = made(type);
  text->text = looked_at(held(other, arguments[0]), other)->text;
  held(type, out) = text;
}

void make_vector(GDExtensionUninitializedTypePtr out, const GDExtensionConstTypePtr* arguments) {
  for (int i = 0; i < 3; ++i) {
    const double part = *reinterpret_cast<const double*>(arguments[i]);
    const float narrow = float(part);
    char* to = reinterpret_cast<char*>(out) + size_t(i) * (is_double ? sizeof part : sizeof narrow);
    std::memcpy(to, is_double ? static_cast<const void*>(&part) : &narrow, is_double ? sizeof part : sizeof narrow);
  }
}

GDExtensionPtrConstructor variant_get_ptr_constructor(Type type, int32_t which) {
  if (type == kString && which == 2) return make_text<kString, kName>;
  if (type == kName && which == 2) return make_text<kName, kString>;
  if (type == kVector3 && which == 3) return make_vector;
#define CASE(known) \
  if (type == known && which == 0) return make_empty<known>;
  CASE(kArray) CASE(kBytes) CASE(kInts) CASE(kVectors2) CASE(kVectors3)
#undef CASE
  return nullptr;
}

template <Type type>
void destroy(GDExtensionTypePtr memory) {
  let_go(held(type, memory), type);
  std::memset(static_cast<void*>(memory), 0xee, type >= kBytes ? 16 : 8);
}

GDExtensionPtrDestructor variant_get_ptr_destructor(Type type) {
#define CASE(known) \
  if (type == known) return destroy<known>;
  CASE(kString) CASE(kName) CASE(kArray) CASE(kBytes) CASE(kInts) CASE(kVectors2) CASE(kVectors3)
#undef CASE
  return nullptr;
}

// Returns content that can be changed. Packed arrays copy shared content first; Arrays do not.
Shared* own(Type type, void* memory) {
  Shared*& shared = held(type, memory);
  if (looked_at(shared, type)->holders > 1 && type != kArray) {
    Shared* copy = made(type);
    copy->bytes = shared->bytes;
    let_go(shared, type);
    shared = copy;
  }
  return shared;
}

template <Type type>
void resize(GDExtensionTypePtr memory, const GDExtensionConstTypePtr* arguments, GDExtensionTypePtr code, int count) {
  const int64_t size = *reinterpret_cast<const int64_t*>(arguments[0]);
  if (count != 1 || size < 0) fault("resize got what it does not take");
  Shared* shared = own(type, memory);
  if (type == kArray) {
    for (size_t i = size_t(size); i < shared->items.size(); ++i) end(shared->items[i]);
    shared->items.resize(size_t(size), Value{kNil, 0, {}});
  } else {
    shared->bytes.resize(size_t(size) * size_of_one(type), 0xdd);
  }
  *reinterpret_cast<int64_t*>(code) = 0;
}

template <Type type>
void size(GDExtensionTypePtr memory, const GDExtensionConstTypePtr*, GDExtensionTypePtr result, int) {
  const Shared* shared = looked_at(held(type, memory), type);
  *reinterpret_cast<int64_t*>(result) =
      int64_t(type == kArray ? shared->items.size() : shared->bytes.size() / size_of_one(type));
}

std::string text_at(GDExtensionConstStringNamePtr name) { return looked_at(held(kName, name), kName)->text; }

GDExtensionPtrBuiltInMethod variant_get_ptr_builtin_method(Type type, GDExtensionConstStringNamePtr name,
                                                           GDExtensionInt hash) {
  const std::string method = text_at(name);
  if (method == without) return nullptr;
#define CASE(known)                                                                   \
  if (type == known && method == "resize" && hash == 848867239) return resize<known>; \
  if (type == known && method == "size" && hash == 3173160232) return size<known>;
  CASE(kArray) CASE(kBytes) CASE(kInts) CASE(kVectors2) CASE(kVectors3)
#undef CASE
  return nullptr;
}

void variant_new_nil(GDExtensionUninitializedVariantPtr out) {
  const Value value{kNil, 0, {}};
  std::memcpy(static_cast<void*>(out), &value, sizeof value);
}

void variant_destroy(GDExtensionVariantPtr value) { end(*reinterpret_cast<Value*>(value)); }

Type variant_get_type(GDExtensionConstVariantPtr value) { return Type(reinterpret_cast<const Value*>(value)->type); }

void string_new_with_utf8_chars(GDExtensionUninitializedStringPtr out, const char* text) {
  Shared* shared = made(kString);
  shared->text = text;
  held(kString, out) = shared;
}

GDExtensionInt string_to_utf8_chars(GDExtensionConstStringPtr string, char* out, GDExtensionInt most) {
  const std::string& text = looked_at(held(kString, string), kString)->text;
  if (out != nullptr) std::memcpy(out, text.data(), std::min(text.size(), size_t(most)));
  return GDExtensionInt(text.size());
}

template <Type type>
unsigned char* at(const void* memory, GDExtensionInt index, bool to_write) {
  Shared* shared = to_write ? own(type, const_cast<void*>(memory)) : looked_at(held(type, memory), type);
  const size_t start = size_t(index) * size_of_one(type);
  if (index < 0 || start >= shared->bytes.size()) fault("an index beyond an array");
  return shared->bytes.data() + start;
}

uint8_t* packed_byte_array_operator_index(GDExtensionTypePtr array, GDExtensionInt index) {
  return at<kBytes>(array, index, true);
}

const uint8_t* packed_byte_array_operator_index_const(GDExtensionConstTypePtr array, GDExtensionInt index) {
  return at<kBytes>(array, index, false);
}

const int32_t* packed_int32_array_operator_index_const(GDExtensionConstTypePtr array, GDExtensionInt index) {
  return reinterpret_cast<const int32_t*>(at<kInts>(array, index, false));
}

int32_t* packed_int32_array_operator_index(GDExtensionTypePtr array, GDExtensionInt index) {
  return reinterpret_cast<int32_t*>(at<kInts>(array, index, true));
}

GDExtensionTypePtr packed_vector2_array_operator_index(GDExtensionTypePtr array, GDExtensionInt index) {
  return reinterpret_cast<GDExtensionTypePtr>(at<kVectors2>(array, index, true));
}

GDExtensionTypePtr packed_vector3_array_operator_index(GDExtensionTypePtr array, GDExtensionInt index) {
  return reinterpret_cast<GDExtensionTypePtr>(at<kVectors3>(array, index, true));
}

GDExtensionVariantPtr array_operator_index(GDExtensionTypePtr array, GDExtensionInt index) {
  Shared* shared = own(kArray, array);
  if (index < 0 || size_t(index) >= shared->items.size()) fault("an index beyond an Array");
  return reinterpret_cast<GDExtensionVariantPtr>(&shared->items[size_t(index)]);
}

// ---- text of input and output ----

std::string in_hex(const std::string& bytes) {
  std::string found;
  char two[3];
  for (const unsigned char byte : bytes) {
    std::snprintf(two, sizeof two, "%02x", byte);
    found += two;
  }
  return found;
}

std::string out_of_hex(const std::string& text) {
  std::string found;
  for (size_t i = 0; i + 1 < text.size(); i += 2) found += char(std::stoi(text.substr(i, 2), nullptr, 16));
  return found;
}

Value read_value(const std::string& text) {
  const std::string rest = text.substr(1);
  Value value{kNil, 0, {}};
  const auto numbers = [&rest](size_t count, float* out) {
    const char* here = rest.c_str();
    for (size_t i = 0; i < count; ++i) {
      char* next = nullptr;
      out[i] = std::strtof(here, &next);
      here = *next == ',' ? next + 1 : next;
    }
  };
  const auto text_of = [&value, &rest](Type type) {
    value.type = type;
    value.shared = made(type);
    value.shared->text = out_of_hex(rest);
  };
  const auto bytes_of = [&value, &rest](Type type) {
    const std::string bytes = out_of_hex(rest);
    value.type = type;
    value.shared = made(type);
    value.shared->bytes.assign(bytes.begin(), bytes.end());
  };
  switch (text[0]) {
    case '-': break;
    case 'b': value.type = kBool, value.truth = rest == "1"; break;
    case 'i': value.type = kInt, value.whole = std::stoll(rest); break;
    case 'f': value.type = kFloat, value.real = std::strtod(rest.c_str(), nullptr); break;
    case 's': text_of(kString); break;
    case 'n': text_of(kName); break;
    case 'v': value.type = kVector3, numbers(3, value.vector); break;
    case 't': {
      float parts[12];
      numbers(12, parts);
      value.type = kTransform;
      value.shared = made(kTransform);
      const auto* first = reinterpret_cast<unsigned char*>(parts);
      value.shared->bytes.assign(first, first + sizeof parts);
      break;
    }
    case 'y': bytes_of(kBytes); break;
    case 'I': bytes_of(kInts); break;
    default: fault("no such value: " + text);
  }
  return value;
}

void write_numbers(char kind, const float* numbers, int count) {
  for (int i = 0; i < count; ++i) std::cout << (i == 0 ? kind : ',') << std::hexfloat << double(numbers[i]);
}

void write_value(const Value& value) {
  switch (value.type) {
    case kNil: std::cout << "-"; return;
    case kBool: std::cout << "b" << int(value.truth); return;
    case kInt: std::cout << "i" << value.whole; return;
    case kFloat: std::cout << "f" << std::hexfloat << value.real; return;
    case kVector3: write_numbers('v', value.vector, 3); return;
    case kTransform: {
      float parts[12];
      std::memcpy(parts, looked_at(value.shared, kTransform)->bytes.data(), sizeof parts);
      write_numbers('t', parts, 12);
      return;
    }
    case kString: std::cout << "s" << in_hex(looked_at(value.shared, kString)->text); return;
    case kArray:
      std::cout << "[";
      for (const Value& item : looked_at(value.shared, kArray)->items) std::cout << " ", write_value(item);
      std::cout << " ]";
      return;
    case kBytes: std::cout << "y"; break;
    case kInts: std::cout << "I"; break;
    case kVectors2: std::cout << "2"; break;
    case kVectors3: std::cout << "3"; break;
    default: fault("a result of type " + std::to_string(value.type));
  }
  const std::vector<unsigned char>& bytes = looked_at(value.shared, Type(value.type))->bytes;
  std::cout << in_hex(std::string(bytes.begin(), bytes.end()));
}

void print_error(const char* text, const char* function, const char*, int32_t, GDExtensionBool) {
  std::cout << "! " << function << " " << text << std::endl;
}

// ---- classes and objects ----

struct Method {
  std::string name;
  GDExtensionClassMethodInfo info;
};

struct Class {
  GDExtensionClassCreationInfo info;
  std::map<std::string, Method> methods;
};

struct Object {
  Class* extension;
  GDExtensionClassInstancePtr instance;
};

std::map<std::string, Class> classes;
int level_now = -1;
const auto library_token = reinterpret_cast<GDExtensionClassLibraryPtr>(0x50f7);

GDExtensionObjectPtr classdb_construct_object(GDExtensionConstStringNamePtr name) {
  if (text_at(name) != "RefCounted") fault("an object of class " + text_at(name));
  ++alive;
  return reinterpret_cast<GDExtensionObjectPtr>(new Object{nullptr, nullptr});
}

void object_set_instance(GDExtensionObjectPtr object, GDExtensionConstStringNamePtr name,
                         GDExtensionClassInstancePtr instance) {
  if (classes.count(text_at(name)) == 0) fault("an instance of an unknown class");
  *reinterpret_cast<Object*>(object) = {&classes[text_at(name)], instance};
}

void classdb_register_extension_class(GDExtensionClassLibraryPtr library, GDExtensionConstStringNamePtr name,
                                      GDExtensionConstStringNamePtr parent, const GDExtensionClassCreationInfo* info) {
  if (library != library_token) fault("another library");
  if (classes.count(text_at(name)) != 0) fault("a class twice");
  if (info->create_instance_func == nullptr || info->free_instance_func == nullptr) fault("a class without instances");
  classes[text_at(name)] = {*info, {}};
  std::cout << "class " << text_at(name) << " " << text_at(parent) << " at " << level_now << "\n";
}

void look_at_property(const GDExtensionPropertyInfo& info) {
  text_at(info.name), text_at(info.class_name);
  looked_at(held(kString, info.hint_string), kString);
  if (info.type != kNil || info.usage != (6 | 131072)) fault("a property that is no Variant");
}

void classdb_register_extension_class_method(GDExtensionClassLibraryPtr library, GDExtensionConstStringNamePtr name,
                                             const GDExtensionClassMethodInfo* info) {
  if (library != library_token) fault("another library");
  if (classes.count(text_at(name)) == 0) fault("a method of an unknown class");
  const std::string method = text_at(info->name);
  if (!classes[text_at(name)].methods.emplace(method, Method{method, *info}).second) fault("a method twice: " + method);
  std::cout << "method " << method << " " << info->argument_count << " " << info->method_flags << " "
            << int(info->has_return_value);
  look_at_property(*info->return_value_info);
  for (uint32_t i = 0; i < info->argument_count; ++i) {
    look_at_property(info->arguments_info[i]);
    if (info->arguments_metadata[i] != GDEXTENSION_METHOD_ARGUMENT_METADATA_NONE) fault("a number that is none");
    std::cout << " " << text_at(info->arguments_info[i].name);
  }
  std::cout << "\n";
}

void classdb_unregister_extension_class(GDExtensionClassLibraryPtr library, GDExtensionConstStringNamePtr name) {
  if (library != library_token || classes.erase(text_at(name)) == 0) fault("an unknown class was taken out");
  std::cout << "unregistered at " << level_now << "\n";
}

GDExtensionInterfaceFunctionPtr get_proc_address(const char* name) {
  if (name == without) return nullptr;
#define CASE(known) \
  if (std::strcmp(name, #known) == 0) return reinterpret_cast<GDExtensionInterfaceFunctionPtr>(known);
  CASE(print_error)
  CASE(variant_new_nil)
  CASE(variant_destroy)
  CASE(variant_get_type)
  CASE(get_variant_from_type_constructor)
  CASE(get_variant_to_type_constructor)
  CASE(variant_get_ptr_constructor)
  CASE(variant_get_ptr_destructor)
  CASE(variant_get_ptr_builtin_method)
  CASE(string_new_with_utf8_chars)
  CASE(string_to_utf8_chars)
  CASE(packed_byte_array_operator_index)
  CASE(packed_byte_array_operator_index_const)
  CASE(packed_int32_array_operator_index)
  CASE(packed_int32_array_operator_index_const)
  CASE(packed_vector2_array_operator_index)
  CASE(packed_vector3_array_operator_index)
  CASE(array_operator_index)
  CASE(classdb_construct_object)
  CASE(classdb_register_extension_class)
  CASE(classdb_register_extension_class_method)
  CASE(classdb_unregister_extension_class)
  CASE(object_set_instance)
#undef CASE
  return nullptr;
}

// ---- commands of the input ----

std::vector<Object*> objects;

void call(Object* object, const std::string& name, std::istringstream& words, bool by_pointers) {
  const auto found = object->extension->methods.find(name);
  if (found == object->extension->methods.end()) fault("no method " + name);
  const GDExtensionClassMethodInfo& info = found->second.info;
  std::vector<Value> arguments;
  for (std::string word; words >> word;) arguments.push_back(read_value(word));
  std::vector<const Value*> addresses;
  for (const Value& argument : arguments) addresses.push_back(&argument);
  Value result{kNil, 0, {}};
  if (by_pointers) {
    if (arguments.size() != info.argument_count) fault("too few arguments of a ptrcall");
    info.ptrcall_func(info.method_userdata, object->instance,
                      reinterpret_cast<const GDExtensionConstTypePtr*>(addresses.data()),
                      reinterpret_cast<GDExtensionTypePtr>(&result));
  } else {
    GDExtensionCallError error{GDEXTENSION_CALL_ERROR_INVALID_METHOD, 0, 0};
    info.call_func(info.method_userdata, object->instance,
                   reinterpret_cast<const GDExtensionConstVariantPtr*>(addresses.data()),
                   GDExtensionInt(arguments.size()), reinterpret_cast<GDExtensionVariantPtr>(&result), &error);
    if (error.error != GDEXTENSION_CALL_OK) fault("a call without an answer");
  }
  std::cout << "= ";
  write_value(result);
  std::cout << std::endl;
  end(result);
  for (Value& argument : arguments) end(argument);
}

void free_object(Object* object) {
  object->extension->info.free_instance_func(object->extension->info.class_userdata, object->instance);
  delete object;
  --alive;
}

}  // namespace

int main(int count, char** words) {
  std::ios::sync_with_stdio(true);
  bool is_old = false;
  for (int i = 2; i < count; ++i) {
    if (std::strcmp(words[i], "--without") == 0 && i + 1 < count) without = words[++i];
    is_double = is_double || std::strcmp(words[i], "--double") == 0;
    is_old = is_old || std::strcmp(words[i], "--old") == 0;
  }
  void* library = count > 1 ? dlopen(words[1], RTLD_NOW) : nullptr;
  if (library == nullptr) fault(count > 1 ? dlerror() : "give a library");
  void* symbol = dlsym(library, "taichi_soft_godot_init");
  if (symbol == nullptr) fault("the library has no entry point");
  const auto entry = reinterpret_cast<GDExtensionInitializationFunction>(symbol);
  GDExtensionInitialization initialization{};
  const uint32_t table_of_4_0[] = {4, 0, 4, 0};
  const auto old = reinterpret_cast<GDExtensionInterfaceGetProcAddress>(reinterpret_cast<uintptr_t>(table_of_4_0));
  if (!entry(is_old ? old : get_proc_address, library_token, &initialization)) {
    std::cout << "refused, left " << alive << std::endl;
    return 0;
  }
  std::cout << "started at " << initialization.minimum_initialization_level << "\n";
  for (level_now = 0; level_now < GDEXTENSION_MAX_INITIALIZATION_LEVEL; ++level_now) {
    initialization.initialize(initialization.userdata, GDExtensionInitializationLevel(level_now));
  }
  std::cout << "ready, left " << alive << std::endl;
  for (std::string line; std::getline(std::cin, line) && line != "end";) {
    std::istringstream rest(line);
    std::string what, name;
    size_t which = 0;
    rest >> what;
    if (what == "new") {
      const GDExtensionClassCreationInfo& info = classes.at("SoftWorldNative").info;
      objects.push_back(reinterpret_cast<Object*>(info.create_instance_func(info.class_userdata)));
      std::cout << "= i" << objects.size() - 1 << std::endl;
    } else if (rest >> which && which < objects.size() && objects[which] != nullptr) {
      if (what == "free") {
        free_object(objects[which]);
        objects[which] = nullptr;
        std::cout << "= -" << std::endl;
      } else if (rest >> name) {
        call(objects[which], name, rest, what == "ptrcall");
      }
    } else {
      fault("no such line: " + line);
    }
  }
  for (level_now = GDEXTENSION_MAX_INITIALIZATION_LEVEL - 1; level_now >= 0; --level_now) {
    initialization.deinitialize(initialization.userdata, GDExtensionInitializationLevel(level_now));
  }
  dlclose(library);
  std::cout << "left " << alive << std::endl;
  return 0;
}
