// Entry points for Godot 3, which register the class SoftWorldNative.
#include "../world_native.hpp"

using taichi_soft_godot::api;
using taichi_soft_godot::kClass;
using taichi_soft_godot::Method;
using taichi_soft_godot::WorldNative;

#define EXPORTED extern "C" __attribute__((visibility("default")))

namespace {

const godot_gdnative_ext_nativescript_api_struct* scripts = nullptr;

void* create(godot_object*, void*) { return new WorldNative; }

void destroy(godot_object*, void*, void* data) { delete static_cast<WorldNative*>(data); }

godot_variant call(godot_object*, void* which, void* data, int count, godot_variant** values) {
  return taichi_soft_godot::call(*static_cast<WorldNative*>(data), *static_cast<const Method*>(which), count, values);
}

}  // namespace

EXPORTED void godot_gdnative_init(godot_gdnative_init_options* options) {
  api = options->api_struct;
  for (unsigned i = 0; i < api->num_extensions; ++i) {
    if (api->extensions[i]->type == GDNATIVE_EXT_NATIVESCRIPT) {
      scripts = reinterpret_cast<const godot_gdnative_ext_nativescript_api_struct*>(api->extensions[i]);
    }
  }
}

EXPORTED void godot_gdnative_terminate(godot_gdnative_terminate_options*) { api = nullptr, scripts = nullptr; }

EXPORTED void godot_nativescript_init(void* handle) {
  scripts->godot_nativescript_register_class(handle, kClass, "Reference", {create, nullptr, nullptr},
                                             {destroy, nullptr, nullptr});
  for (const Method& method : taichi_soft_godot::methods) {
    scripts->godot_nativescript_register_method(handle, kClass, method.name, {GODOT_METHOD_RPC_MODE_DISABLED},
                                                {call, const_cast<Method*>(&method), nullptr});
  }
}
