// Replaces files.cpp in builds for the web, and adds functions for JavaScript that taichi_soft.h does not declare.
#include "kernels.hpp"
#include "scene.hpp"

namespace taichi_soft {

void Kernels::close() {}

Scene::Scene(const std::string& folder) : Scene(std::vector<char>(), folder) {}  // fails: the web has no folders

}  // namespace taichi_soft

extern "C" {

extern const ts_linked_kernel taichi_soft_kernels[];

__attribute__((import_module("taichi_soft"), import_name("before_step"))) void taichi_soft_before_step(ts_world world);

TS_API ts_result ts_web_load(const void* world, size_t size, ts_scene* scene) {
  return ts_scene_load_linked(world, size, taichi_soft_kernels, scene);
}

TS_API ts_result ts_web_listen(ts_world world) {
  return ts_world_on_step(world, [](ts_world own, void*) { taichi_soft_before_step(own); }, nullptr);
}

}  // extern "C"
