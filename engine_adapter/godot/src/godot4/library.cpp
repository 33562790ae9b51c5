// Entry point for Godot 4, which registers the class SoftWorldNative.
#include <deque>

#include "../world_native.hpp"

using taichi_soft_godot::Address;
using taichi_soft_godot::godot;
using taichi_soft_godot::kClass;
using taichi_soft_godot::Method;
using taichi_soft_godot::Name;
using taichi_soft_godot::String;
using taichi_soft_godot::Variant;
using taichi_soft_godot::WorldNative;

namespace {

GDExtensionClassLibraryPtr library = nullptr;

GDExtensionObjectPtr create(void*) {
  const GDExtensionObjectPtr object = godot.classdb_construct_object(Name("RefCounted").address());
  godot.object_set_instance(object, Name(kClass).address(), Address(new WorldNative));
  return object;
}

void destroy(void*, GDExtensionClassInstancePtr instance) { delete reinterpret_cast<WorldNative*>(instance); }

void call_into(void* result, void* which, GDExtensionClassInstancePtr instance, int count, const void* values) {
  const Method& method = *static_cast<const Method*>(which);
  const Variant found = taichi_soft_godot::call(*reinterpret_cast<WorldNative*>(instance), method, count,
                                                static_cast<const Variant* const*>(values));
  godot.variant_destroy(Address(result));  // destroy the previous value, usually nil
  *static_cast<Variant*>(result) = found;
}

void call(void* which, GDExtensionClassInstancePtr instance, const GDExtensionConstVariantPtr* values,
          GDExtensionInt count, GDExtensionVariantPtr result, GDExtensionCallError* error) {
  call_into(result, which, instance, int(count), values);
  error->error = GDEXTENSION_CALL_OK;  // scripts continue after a refused call and check for null
}

// Method for callers that have already checked types and counts. All values are Variants, as in `call`.
void call_typed(void* which, GDExtensionClassInstancePtr instance, const GDExtensionConstTypePtr* values,
                GDExtensionTypePtr result) {
  call_into(result, which, instance, static_cast<const Method*>(which)->argument_count, values);
}

void register_class() {
  const Name name(kClass), parent("RefCounted");
  GDExtensionClassCreationInfo info{};
  info.create_instance_func = create;
  info.free_instance_func = destroy;
  godot.classdb_register_extension_class(library, name.address(), parent.address(), &info);
}

void register_method(const Method& method) {
  const Name class_name(kClass), name(method.name), no_class("");
  const String no_hint("");
  std::deque<Name> names;
  std::vector<GDExtensionPropertyInfo> arguments;
  std::vector<GDExtensionClassMethodArgumentMetadata> metadata;
  // Type Variant: PROPERTY_USAGE_DEFAULT with PROPERTY_USAGE_NIL_IS_VARIANT, see extension_api.json.
  GDExtensionPropertyInfo any{GDEXTENSION_VARIANT_TYPE_NIL, no_class.address(), no_class.address(), 0,
                              no_hint.address(), 6 | 131072};
  for (int i = 0; i < method.argument_count; ++i) {
    names.emplace_back(("argument_" + std::to_string(i + 1)).c_str());
    arguments.push_back(any);
    arguments.back().name = names.back().address();
    metadata.push_back(GDEXTENSION_METHOD_ARGUMENT_METADATA_NONE);
  }
  GDExtensionClassMethodInfo info{};
  info.name = name.address();
  info.method_userdata = const_cast<Method*>(&method);
  info.call_func = call;
  info.ptrcall_func = call_typed;
  info.method_flags = GDEXTENSION_METHOD_FLAGS_DEFAULT;
  info.has_return_value = true;
  info.return_value_info = &any;
  info.return_value_metadata = GDEXTENSION_METHOD_ARGUMENT_METADATA_NONE;
  info.argument_count = uint32_t(method.argument_count);
  info.arguments_info = arguments.data();
  info.arguments_metadata = metadata.data();
  godot.classdb_register_extension_class_method(library, class_name.address(), &info);
}

void initialize(void*, GDExtensionInitializationLevel level) {
  if (level != GDEXTENSION_INITIALIZATION_SCENE) return;
  register_class();
  for (const Method& method : taichi_soft_godot::methods) register_method(method);
}

void deinitialize(void*, GDExtensionInitializationLevel level) {
  if (level != GDEXTENSION_INITIALIZATION_SCENE) return;
  godot.classdb_unregister_extension_class(library, Name(kClass).address());
}

}  // namespace

extern "C" __attribute__((visibility("default"))) GDExtensionBool taichi_soft_godot_init(
    GDExtensionInterfaceGetProcAddress get_proc_address, GDExtensionClassLibraryPtr its_library,
    GDExtensionInitialization* initialization) {
  try {
    taichi_soft_godot::find_functions(get_proc_address);
  } catch (const std::exception& error) {
    taichi_soft_godot::show_error(error.what(), "taichi_soft_godot_init");
    return false;
  }
  library = its_library;
  initialization->minimum_initialization_level = GDEXTENSION_INITIALIZATION_SCENE;
  initialization->userdata = nullptr;
  initialization->initialize = initialize;
  initialization->deinitialize = deinitialize;
  return true;
}
