// The functions of taichi_soft.h. Each function checks its arguments, locks the world and catches all exceptions.

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

#include "floats.hpp"
#include "handles.hpp"
#include "scene.hpp"
#include "world.hpp"

using namespace taichi_soft;

namespace {

Handles<Scene>& scenes() {
  static auto* found = new Handles<Scene>("scene", 1);  // never destroyed, because threads may outlive main
  return *found;
}

Handles<World>& worlds() {
  static auto* found = new Handles<World>("world", 2);
  return *found;
}

thread_local char last_error[512] = "";

void record_error(const char* text) {
  std::strncpy(last_error, text, sizeof last_error - 1);
  last_error[sizeof last_error - 1] = 0;
}

template <typename Function>
ts_result guarded(Function function) noexcept {
  const WithUsualFloats floats;
#if defined(__wasm__)
  function();  // throws no C++ exceptions, see `fail`
  return TS_OK;
#else
  try {
    function();
    return TS_OK;
  } catch (const Error& error) {
    record_error(error.what());
    return error.code;
  } catch (const std::bad_alloc&) {
    record_error("there is not enough memory");
  } catch (const std::exception& error) {
    record_error(error.what());
  } catch (...) {
    record_error("unknown error");
  }
  return TS_ERROR_RUNTIME;
#endif
}

// Lists valid names for an error text, as many as fit.
std::string choice(const std::vector<std::string>& names) {
  if (names.empty()) return "the world file has none of that kind";
  std::string found = "give one of ";
  for (size_t i = 0; i < names.size(); ++i) {
    if (found.size() + names[i].size() > 300) return found + "and " + std::to_string(names.size() - i) + " more";
    found += names[i] + (i + 1 < names.size() ? ", " : "");
  }
  return found;
}

// Exclusive access to a world during one call.
class Turn {
 public:
  explicit Turn(ts_world handle) : world_(worlds().find(handle)), lock_(world_->turn) {
    const bool is_free =
        lock_.has_succeeded() && (world_->advancing == ThreadId() || world_->advancing == this_thread());
    if (!is_free) fail(TS_ERROR_BUSY, "another thread is in a call of this world");
  }
  World* operator->() const { return &*world_; }
  World& operator*() const { return *world_; }
  const Axes& axes() const { return world_->scene().axes; }

 private:
  Kept<World> world_;  // declared before the lock, so that the lock is released first
  Attempt lock_;
};

// Makes the steps of one frame. Between steps, only the same thread can call the world, so that its callback can move
// colliders. If a step fails, the time of the remaining steps is dropped.
class Frame {
 public:
  Frame(ts_world handle, double seconds) : handle_(handle), world_(worlds().find(handle)) {
    const Turn turn(handle);
    if (world_->advancing != ThreadId()) fail(TS_ERROR_STATE, "ts_world_advance was called from its own callback");
    due = world_->steps_due(seconds);
    world_->advancing = this_thread();
  }
  ~Frame() { end(); }
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;

  void before_step() {
    ts_before_step function = nullptr;
    void* user = nullptr;
    {
      const Turn turn(handle_);
      function = turn->before_step();
      user = turn->user();
    }
    if (function != nullptr) function(handle_, user);
  }

  void end() noexcept {
    if (is_over_) return;
    const Guard lock(world_->turn);
    world_->end_frame();
    is_over_ = true;
  }

  int32_t due = 0;

 private:
  ts_world handle_;
  Kept<World> world_;
  bool is_over_ = false;
};

template <typename Pointer>
Pointer given(Pointer pointer, const char* name) {
  if (pointer == nullptr) fail(TS_ERROR_ARGUMENT, "%s is null", name);
  return pointer;
}

const double* finite(const double* numbers, size_t count, const char* name) {
  given(numbers, name);
  for (size_t i = 0; i < count; ++i) {
    if (!(std::fabs(numbers[i]) <= 1e30)) fail(TS_ERROR_ARGUMENT, "%s has %g in it", name, numbers[i]);
  }
  return numbers;
}

Vector place(const Turn& world, const double* host, const char* name) {
  const Vector found = world.axes().place_in(finite(host, 3, name));
  for (double each : found) {
    if (!(std::fabs(each) < world->scene().position_limit)) {
      fail(TS_ERROR_ARGUMENT, "%s is %g m away: stay within %g m", name, each, world->scene().position_limit);
    }
  }
  return found;
}

// Converts a velocity or an impulse, which use the same axes and unit of length as positions.
Vector vector(const Turn& world, const double* host, const char* name) {
  const Vector found = world.axes().place_in(finite(host, 3, name));
  for (double each : found) {
    if (!(std::fabs(each) <= world->scene().impulse_limit)) fail(TS_ERROR_ARGUMENT, "%s is too large: %g", name, each);
  }
  return found;
}

Vector spin(const Turn& world, const double* host, const char* name) {
  return world.axes().turn_in(finite(host, 3, name));
}

Quaternion rotation(const Turn& world, const double* host, const char* name) {
  Quaternion found = world.axes().rotation_in(finite(host, 4, name));
  const double length = length_of(found);
  if (!(std::fabs(length - 1.0) <= 1e-3)) {
    fail(TS_ERROR_ARGUMENT, "%s is a quaternion of length %g: normalise it", name, length);
  }
  for (double& each : found) each = each / length;
  return found;
}

Pose pose(const Turn& world, const ts_pose* host) {
  given(host, "pose");
  // Convert through a matrix, as Python does because it also accepts matrices.
  const Quaternion turn = quaternion_of(matrix_of(rotation(world, host->rotation, "rotation")));
  return {place(world, host->position, "position"), turn};
}

Pose frame_pose(const Turn& world, const ts_pose* host) {
  given(host, "pose");
  return {place(world, host->position, "position"), rotation(world, host->rotation, "rotation")};
}

double length(const Turn& world, double host, double least, const char* name) {
  const double found = world.axes().length_in(host);
  if (!(found >= least && found <= 1e6))
    fail(TS_ERROR_ARGUMENT, "%s is %g: give a length of %g to 1e6 m", name, host, least);
  return found;
}

// Fills in the shape of a collider, with the same values as taichi_soft/contact/shapes.
void fill_shape(const Turn& world, const ts_shape& shape, Collider* row) {
  constexpr double kShortest = 1e-6;
  Vector half = {0.0, 0.0, 0.0};
  switch (shape.kind) {
    case TS_PLANE:
      row->parameters[2] = 1.0f;
      half = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
      break;
    case TS_SPHERE:
      half[0] = half[1] = half[2] = length(world, shape.size[0], kShortest, "radius");
      row->parameters[0] = float(half[0]);
      break;
    case TS_BOX: {
      for (double each : shape.size) length(world, each, kShortest, "size");
      const Vector size = world.axes().place_in(shape.size);
      for (int k = 0; k < 3; ++k) half[k] = std::fabs(size[k]) / 2, row->parameters[k] = float(half[k]);
      break;
    }
    case TS_CAPSULE: {
      const double radius = length(world, shape.size[0], kShortest, "radius");
      const double along = length(world, shape.size[1], 0.0, "length") / 2;
      row->parameters[0] = float(radius);
      row->parameters[1] = float(along);
      half = {radius, radius, along + radius};
      break;
    }
    case kHeightField:
    case kMeshShape:
      fail(TS_ERROR_ARGUMENT,
           "kind is %d: height fields and meshes need a distance grid, which Python computes before the export. Export "
           "the world with them, and move them here",
           shape.kind);
    default:
      fail(TS_ERROR_ARGUMENT, "kind is %d: give TS_PLANE to TS_CAPSULE", shape.kind);
  }
  if (!(shape.friction >= 0.0 && shape.friction <= 1e6)) fail(TS_ERROR_ARGUMENT, "friction is %g", shape.friction);
  if (!(shape.restitution <= 1.0)) fail(TS_ERROR_ARGUMENT, "restitution is %g: give 0 to 1", shape.restitution);
  row->kind = shape.kind;
  row->bounds = {{-half[0], -half[1], -half[2]}, half};
  row->skin = length(world, shape.thickness, 0.0, "thickness") + (shape.kind == TS_BOX ? world->seam() : 0.0);
  row->friction = shape.friction;
  row->restitution = shape.restitution < 0.0 ? -1.0 : shape.restitution;
  row->group = shape.group;
  row->mask = shape.mask;
}

// The speed of a rotating motor is in rad/s and its limit a torque. The speed of a pushing motor is in length/s and its
// limit a force.
double motor_speed_in(const Turn& world, bool turns, double host) {
  return turns ? host : world.axes().length_in(host);
}

double motor_limit_in(const Turn& world, bool turns, double host) {
  const double once = world.axes().length_in(host);
  return turns ? world.axes().length_in(once) : once;
}

Vertices list(const int32_t* vertices, size_t count) {
  if (count > 0) given(vertices, "vertices");
  if (count > 100000000) fail(TS_ERROR_ARGUMENT, "count is %zu, more than the vertices of any body", count);
  return {vertices, count};
}

template <typename Struct>
Struct* sized(Struct* given_struct, const char* name) {
  given(given_struct, name);
  if (given_struct->struct_size != sizeof(Struct)) {
    fail(TS_ERROR_VERSION, "%s has struct_size %u: set it to sizeof, which is %zu in this version", name,
         given_struct->struct_size, sizeof(Struct));
  }
  return given_struct;
}

void require_size(size_t count, size_t needed, const char* name) {
  if (count != needed) fail(TS_ERROR_SIZE, "%s has room for %zu numbers: give room for %zu", name, count, needed);
}

Drive drive_of(const Turn& world, const ts_drive& host) {
  Drive found{};
  found.turns = host.turns != 0, found.is_fixed = host.is_fixed != 0, found.has_point = host.has_point != 0;
  const double* axis = finite(host.axis, 3, "axis");
  found.axis = found.turns ? world.axes().turn_in(axis) : world.axes().normal_in(axis);
  if (found.has_point) found.point = place(world, host.point, "point");
  found.speed = motor_speed_in(world, found.turns, host.speed);
  found.limit = motor_limit_in(world, found.turns, host.limit);
  return found;
}

double as_reach(const Turn& world, double host) {
  if (!(host > 0.0)) fail(TS_ERROR_ARGUMENT, "reach is %g: give a length above 0", host);
  return world.axes().length_in(host);
}

void write_hit(const Turn& world, const Hit& found, ts_hit* hit) {
  hit->body = found.slot < 0 ? 0 : world->body_in(found.slot);
  if (found.slot < 0) return;
  hit->triangle = found.triangle;
  hit->is_inside = found.is_inside;
  hit->distance = found.distance * world.axes().scale();
  world.axes().place_out(found.point, hit->point);
  world.axes().normal_out(found.normal, hit->normal);
  for (int k = 0; k < 3; ++k) hit->weights[k] = found.weights[k], hit->vertices[k] = found.vertices[k];
}

void write_touch(const Turn& world, const Hit& found, ts_touch* touch) {
  touch->body = found.slot < 0 ? 0 : world->body_in(found.slot);
  touch->collider = found.collider;
  if (found.slot < 0 && found.collider < 0) return;
  touch->triangle = found.triangle;
  touch->is_inside = found.is_inside;
  touch->distance = std::max(found.distance, 0.0) * world.axes().scale();
  touch->depth = std::max(-found.distance, 0.0) * world.axes().scale();
  world.axes().place_out(found.point, touch->point);
  world.axes().normal_out(found.normal, touch->normal);
  if (found.slot < 0) return;
  for (int k = 0; k < 3; ++k) touch->weights[k] = found.weights[k], touch->vertices[k] = found.vertices[k];
}

int32_t as_targets(int32_t targets) {
  if (targets <= 0 || (targets & ~(TS_BODIES | TS_COLLIDERS)) != 0) {
    fail(TS_ERROR_ARGUMENT, "targets is %d: give TS_BODIES, TS_COLLIDERS or their sum", targets);
  }
  return targets;
}

void write_overlaps(const Turn& world, const std::vector<int32_t>& slots, ts_body* bodies, size_t capacity,
                    size_t* count) {
  if (slots.size() > capacity) {
    fail(TS_ERROR_SIZE, "bodies has room for %zu: give room for %zu", capacity, slots.size());
  }
  if (!slots.empty()) given(bodies, "bodies");
  for (size_t i = 0; i < slots.size(); ++i) bodies[i] = world->body_in(slots[i]);
  *count = slots.size();
}

const Asset& asset_in(const Scene& scene, int32_t asset) {
  if (asset < 0 || size_t(asset) >= scene.assets.size()) {
    fail(TS_ERROR_ARGUMENT, "asset %d does not exist (%zu in all, numbered from 0)", asset, scene.assets.size());
  }
  return scene.assets[size_t(asset)];
}

const Mesh& mesh_of(const Scene& scene, int32_t mesh) {
  if (mesh < 0 || size_t(mesh) >= scene.meshes.size()) {
    fail(TS_ERROR_ARGUMENT, "mesh %d does not exist (%zu in all, numbered from 0)", mesh, scene.meshes.size());
  }
  return scene.meshes[size_t(mesh)];
}

}  // namespace

extern "C" {

uint32_t ts_version(void) { return TS_VERSION; }

const char* ts_last_error(void) { return last_error; }

ts_result ts_scene_load(const char* folder, ts_scene* scene) {
  return guarded([&] {
    given(scene, "scene");
    *scene = scenes().add(std::make_shared<Scene>(given(folder, "folder")));
  });
}

ts_result ts_scene_load_linked(const void* world, size_t size, const ts_linked_kernel* kernels, ts_scene* scene) {
  return guarded([&] {
    given(scene, "scene");
    given(kernels, "kernels");
    const char* bytes = static_cast<const char*>(given(world, "world"));
    *scene = scenes().add(std::make_shared<Scene>(std::vector<char>(bytes, bytes + size), kernels));
  });
}

ts_result ts_scene_unload(ts_scene scene) {
  return guarded([&] { scenes().remove(scene); });
}

ts_result ts_scene_get_info(ts_scene scene, ts_scene_info* info) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    sized(info, "info");
    info->slot_count = found->slot_count;
    info->asset_count = int32_t(found->assets.size());
    info->collider_count = int32_t(found->names(TS_COLLIDER).size());
    info->frame_count = int32_t(found->names(TS_FRAME).size());
    info->mesh_count = int32_t(found->meshes.size());
  });
}

ts_result ts_scene_find(ts_scene scene, int32_t kind, const char* name, int32_t* number) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    given(number, "number");
    const auto& names = found->names(kind);
    const auto at = std::find(names.begin(), names.end(), given(name, "name"));
    if (at == names.end()) {
      fail(TS_ERROR_ARGUMENT, "unknown name %.100s: %s", name, choice(names).c_str());
    }
    *number = int32_t(at - names.begin());
  });
}

ts_result ts_scene_get_name(ts_scene scene, int32_t kind, int32_t number, char* name, size_t capacity) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    given(name, "name");
    const auto& names = found->names(kind);
    if (number < 0 || size_t(number) >= names.size())
      fail(TS_ERROR_ARGUMENT, "number %d does not exist (%zu in all, numbered from 0)", number, names.size());
    const std::string& text = names[size_t(number)];
    if (capacity < text.size() + 1)
      fail(TS_ERROR_SIZE, "name has room for %zu bytes: give %zu", capacity, text.size() + 1);
    std::memcpy(name, text.c_str(), text.size() + 1);
  });
}

ts_result ts_asset_get_info(ts_scene scene, int32_t asset, ts_asset_info* info) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    sized(info, "info");
    const Asset& row = asset_in(*found, asset);
    double mass = 0.0;
    for (double each : row.masses) mass += each;
    info->vertex_count = int32_t(row.vertex_count());
    info->slot_count = row.slot_count;
    info->mass = float(mass);
  });
}

ts_result ts_asset_get_level_count(ts_scene scene, int32_t asset, int32_t* count) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    *given(count, "count") = int32_t(asset_in(*found, asset).level_count());
  });
}

ts_result ts_mesh_get_level(ts_scene scene, int32_t mesh, int32_t* level) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    *given(level, "level") = mesh_of(*found, mesh).level;
  });
}

ts_result ts_mesh_get_info(ts_scene scene, int32_t mesh, ts_mesh_info* info) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    sized(info, "info");
    const Mesh& row = mesh_of(*found, mesh);
    info->asset = row.asset;
    info->vertex_count = int32_t(row.vertex_count);
    info->triangle_count = int32_t(row.triangles.count / 3);
    info->has_uv = row.uv.count != 0;
  });
}

ts_result ts_mesh_get_triangles(ts_scene scene, int32_t mesh, uint32_t* indices, size_t count) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    given(indices, "indices");
    const Mesh& row = mesh_of(*found, mesh);
    require_size(count, row.triangles.count, "indices");
    std::copy(row.triangles.begin(), row.triangles.end(), indices);
    if (!found->axes.are_left_handed()) return;
    for (size_t i = 0; i + 3 <= count; i += 3) std::swap(indices[i + 1], indices[i + 2]);  // for left-handed axes
  });
}

ts_result ts_mesh_get_uv(ts_scene scene, int32_t mesh, float* uv, size_t count) {
  return guarded([&] {
    const auto found = scenes().find(scene);
    given(uv, "uv");
    const Mesh& row = mesh_of(*found, mesh);
    require_size(count, row.uv.count, "uv");
    std::copy(row.uv.begin(), row.uv.end(), uv);
  });
}

ts_result ts_world_create(ts_scene scene, ts_world* world) {
  return guarded([&] {
    given(world, "world");
    *world = worlds().add(std::make_shared<World>(scenes().share(scene)));
  });
}

ts_result ts_world_destroy(ts_world world) {
  return guarded([&] {
    const Turn turn(world);  // waits until no other thread is in a call
    worlds().remove(world);
  });
}

ts_result ts_world_set_fixed_step(ts_world world, const ts_fixed_step* step) {
  return guarded([&] {
    const Turn turn(world);
    sized(step, "step");
    turn->set_fixed_step(step->dt, step->substeps, step->max_steps);
  });
}

ts_result ts_world_on_step(ts_world world, ts_before_step function, void* user) {
  return guarded([&] { Turn(world)->on_step(function, user); });
}

ts_result ts_world_set_threads(ts_world world, int32_t count) {
  return guarded([&] { Turn(world)->set_threads(count); });
}

ts_result ts_world_set_job_system(ts_world world, ts_run_jobs function, void* user) {
  return guarded([&] { Turn(world)->set_job_system(function, user); });
}

ts_result ts_world_step(ts_world world, double dt, int32_t substeps) {
  return guarded([&] { Turn(world)->step(dt, substeps); });
}

ts_result ts_world_advance(ts_world world, double seconds, ts_clock* clock) {
  return guarded([&] {
    if (clock != nullptr) sized(clock, "clock");
    Frame frame(world, seconds);
    for (int32_t i = 0; i < frame.due; ++i) {
      frame.before_step();
      Turn(world)->step_in_time();
    }
    frame.end();
    if (clock != nullptr) Turn(world)->write_clock(clock, frame.due);
  });
}

#if defined(__wasm__)
// Ends a `Frame` that was not ended because JavaScript threw an exception.
TS_API ts_result ts_web_end_frame(ts_world world) {
  worlds().find(world)->end_frame();
  return TS_OK;
}
#endif

ts_result ts_world_get_clock(ts_world world, ts_clock* clock) {
  return guarded([&] {
    const Turn turn(world);
    turn->write_clock(sized(clock, "clock"), 0);
  });
}

ts_result ts_world_stable_substeps(ts_world world, double dt, int32_t* substeps) {
  return guarded([&] {
    const Turn turn(world);
    *given(substeps, "substeps") = turn->stable_substeps(dt);
  });
}

ts_result ts_world_wake(ts_world world) {
  return guarded([&] { Turn(world)->wake(); });
}

ts_result ts_world_set_wind(ts_world world, const double velocity[3], double density, double drag) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_wind(vector(turn, velocity, "velocity"), density, drag);
  });
}

ts_result ts_world_shift_origin(ts_world world, const double offset[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->shift_origin(place(turn, offset, "offset"));
  });
}

ts_result ts_world_set_view_origin(ts_world world, const double point[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_view_origin(place(turn, point, "point"));
  });
}

ts_result ts_world_set_friction(ts_world world, double friction) {
  return guarded([&] { Turn(world)->set_friction(friction); });
}

ts_result ts_world_set_gravity(ts_world world, const double gravity[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_gravity(turn.axes().place_in(finite(gravity, 3, "gravity")));
  });
}

ts_result ts_world_radial_impulse(ts_world world, const double center[3], double impulse, double radius) {
  return guarded([&] {
    const Turn turn(world);
    turn->radial_impulse(place(turn, center, "center"), turn.axes().length_in(impulse), turn.axes().length_in(radius));
  });
}

ts_result ts_world_hash(ts_world world, uint64_t* hash) {
  return guarded([&] {
    const Turn turn(world);
    *given(hash, "hash") = turn->hash();
  });
}

ts_result ts_world_snapshot(ts_world world, void* buffer, size_t capacity, size_t* size) {
  return guarded([&] {
    const Turn turn(world);
    given(size, "size");
    const size_t needed = turn->snapshot_size();
    if (buffer != nullptr) {
      if (capacity < needed) fail(TS_ERROR_SIZE, "buffer has %zu bytes: give %zu", capacity, needed);
      turn->snapshot(static_cast<char*>(buffer));
    }
    *size = needed;
  });
}

ts_result ts_world_restore(ts_world world, const void* bytes, size_t size) {
  return guarded([&] {
    const Turn turn(world);
    turn->restore(static_cast<const char*>(given(bytes, "bytes")), size);
  });
}

ts_result ts_world_record_events(ts_world world, int32_t kinds) {
  return guarded([&] { Turn(world)->record_events(kinds); });
}

ts_result ts_world_drain_events(ts_world world, ts_event* events, size_t event_size, size_t capacity, size_t* count) {
  return guarded([&] {
    const Turn turn(world);
    given(count, "count");
    if (event_size != sizeof(ts_event)) {
      fail(TS_ERROR_VERSION, "event_size is %zu: an event has %zu bytes in this version", event_size, sizeof(ts_event));
    }
    if (capacity > 0) given(events, "events");
    *count = turn->events().drain(events, capacity);
    for (size_t i = 0; i < *count; ++i) {
      turn.axes().place_out({events[i].impulse[0], events[i].impulse[1], events[i].impulse[2]}, events[i].impulse);
    }
  });
}

ts_result ts_world_dropped_events(ts_world world, int64_t* count) {
  return guarded([&] {
    const Turn turn(world);
    *given(count, "count") = turn->events().dropped();
  });
}

ts_result ts_world_spawn(ts_world world, int32_t asset, const ts_placement* where, ts_body* body) {
  return guarded([&] {
    const Turn turn(world);
    sized(where, "place");
    given(body, "body");
    const Vector drift = vector(turn, where->velocity, "velocity");
    for (double each : drift) {
      if (!(std::fabs(each) < turn->scene().velocity_limit)) fail(TS_ERROR_ARGUMENT, "velocity is too fast: %g", each);
    }
    *body = turn->spawn(asset, place(turn, where->position, "position"), rotation(turn, where->rotation, "rotation"),
                        drift, spin(turn, where->spin, "spin"));
  });
}

ts_result ts_world_despawn(ts_world world, ts_body body) {
  return guarded([&] {
    const Turn turn(world);
    turn->despawn(turn->slot_of(body));
  });
}

ts_result ts_body_set_enabled(ts_world world, ts_body body, int32_t is_enabled) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_enabled(turn->slot_of(body), is_enabled != 0);
  });
}

ts_result ts_world_get_body(ts_world world, int32_t slot, ts_body* body) {
  return guarded([&] {
    const Turn turn(world);
    *given(body, "body") = turn->body_in(slot);
  });
}

ts_result ts_body_get_asset(ts_world world, ts_body body, int32_t* asset) {
  return guarded([&] {
    const Turn turn(world);
    *given(asset, "asset") = turn->scene().asset_of_slot[size_t(turn->slot_of(body))];
  });
}

ts_result ts_body_get_status(ts_world world, ts_body body, int32_t* status) {
  return guarded([&] {
    const Turn turn(world);
    *given(status, "status") = turn->status_of(turn->slot_of(body));
  });
}

ts_result ts_body_set_level(ts_world world, ts_body body, int32_t level, int32_t release) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_level(turn->slot_of(body), level, release != 0);
  });
}

ts_result ts_body_get_level(ts_world world, ts_body body, int32_t* level) {
  return guarded([&] {
    const Turn turn(world);
    *given(level, "level") = turn->level_of(turn->slot_of(body));
  });
}

ts_result ts_body_get_vertex_count(ts_world world, ts_body body, int32_t* count) {
  return guarded([&] {
    const Turn turn(world);
    *given(count, "count") = int32_t(turn->asset_of(turn->slot_of(body)).vertex_count());
  });
}

ts_result ts_body_positions(ts_world world, ts_body body, double alpha, float* positions, size_t count) {
  return guarded([&] {
    const Turn turn(world);
    const int32_t slot = turn->slot_of(body);
    require_size(count, 3 * turn->asset_of(slot).vertex_count(), "positions");
    turn->read_positions(slot, alpha, given(positions, "positions"));
  });
}

ts_result ts_body_mesh(ts_world world, ts_body body, int32_t mesh, float* positions, float* normals, size_t count) {
  return guarded([&] {
    const Turn turn(world);
    const int32_t slot = turn->slot_of(body);
    const Mesh& row = mesh_of(turn->scene(), mesh);
    if (row.asset != turn->scene().asset_of_slot[size_t(slot)]) {
      fail(TS_ERROR_ARGUMENT, "mesh %d belongs to asset %d, and the body to another one", mesh, row.asset);
    }
    if (row.level >= 0 && row.level != turn->level_of(slot)) {
      fail(TS_ERROR_STATE, "mesh %d is for level %d, the body is at level %d: draw the mesh of that level, or a skin",
           mesh, row.level, turn->level_of(slot));
    }
    require_size(count, 3 * row.vertex_count, "positions");
    turn->read_mesh(slot, mesh, given(positions, "positions"), normals);
  });
}

ts_result ts_body_center(ts_world world, ts_body body, double center[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn.axes().place_out(turn->center_of(turn->slot_of(body)), given(center, "center"));
  });
}

ts_result ts_body_set_velocity(ts_world world, ts_body body, const double linear[3], const double turning[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_velocity(turn->slot_of(body), vector(turn, linear, "linear"), spin(turn, turning, "spin"));
  });
}

ts_result ts_body_teleport(ts_world world, ts_body body, const double center[3], const double turn_by[4],
                           int32_t keeps_velocity) {
  return guarded([&] {
    const Turn turn(world);
    turn->teleport(turn->slot_of(body), place(turn, center, "center"), rotation(turn, turn_by, "turn"),
                   keeps_velocity != 0);
  });
}

ts_result ts_body_apply_impulse(ts_world world, ts_body body, const double impulse[3], const int32_t* vertices,
                                size_t count) {
  return guarded([&] {
    const Turn turn(world);
    turn->apply_impulse(turn->slot_of(body), vector(turn, impulse, "impulse"), list(vertices, count));
  });
}

ts_result ts_body_apply_force(ts_world world, ts_body body, const double force[3], const int32_t* vertices,
                              size_t count) {
  return guarded([&] {
    const Turn turn(world);
    turn->apply_force(turn->slot_of(body), vector(turn, force, "force"), list(vertices, count));
  });
}

ts_result ts_body_impulse_at(ts_world world, ts_body body, const double impulse[3], const double point[3],
                             double radius) {
  return guarded([&] {
    const Turn turn(world);
    turn->impulse_at(turn->slot_of(body), vector(turn, impulse, "impulse"), place(turn, point, "point"),
                     turn.axes().length_in(radius));
  });
}

ts_result ts_body_set_gravity_scale(ts_world world, ts_body body, double scale) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_gravity_scale(turn->slot_of(body), scale);
  });
}

ts_result ts_body_set_friction(ts_world world, ts_body body, double friction) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_body_friction(turn->slot_of(body), friction);
  });
}

ts_result ts_body_set_filter(ts_world world, ts_body body, int32_t group, int32_t mask) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_body_filter(turn->slot_of(body), group, mask);
  });
}

ts_result ts_body_set_damping(ts_world world, ts_body body, double rate) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_damping(turn->slot_of(body), rate);
  });
}

ts_result ts_body_set_sheltered(ts_world world, ts_body body, int32_t is_sheltered) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_sheltered(turn->slot_of(body), is_sheltered != 0);
  });
}

ts_result ts_body_pin(ts_world world, ts_body body, const int32_t* vertices, size_t count) {
  return guarded([&] {
    const Turn turn(world);
    turn->pin(turn->slot_of(body), list(vertices, count));
  });
}

ts_result ts_body_unpin(ts_world world, ts_body body, const int32_t* vertices, size_t count) {
  return guarded([&] {
    const Turn turn(world);
    turn->unpin(turn->slot_of(body), list(vertices, count));
  });
}

ts_result ts_body_set_targets(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                              const float* targets) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_targets(turn->slot_of(body), list(vertices, count), given(targets, "targets"));
  });
}

ts_result ts_body_attach(ts_world world, ts_body body, const int32_t* vertices, size_t count, int32_t frame,
                         int32_t feels) {
  return guarded([&] {
    const Turn turn(world);
    turn->attach(turn->slot_of(body), list(vertices, count), frame, feels != 0);
  });
}

ts_result ts_body_detach(ts_world world, ts_body body, const int32_t* vertices, size_t count) {
  return guarded([&] {
    const Turn turn(world);
    turn->detach(turn->slot_of(body), list(vertices, count));
  });
}

ts_result ts_body_set_break_force(ts_world world, ts_body body, int32_t frame, double force) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_break_force(turn->slot_of(body), frame, turn.axes().length_in(force));
  });
}

ts_result ts_body_get_load(ts_world world, ts_body body, int32_t frame, double force[3], double torque[3]) {
  return guarded([&] {
    const Turn turn(world);
    Vector pull, moment;
    turn->load(turn->slot_of(body), frame, &pull, &moment);
    if (force != nullptr) turn.axes().place_out(pull, force);
    if (torque != nullptr) turn.axes().moment_out(moment, torque);
  });
}

ts_result ts_body_grab(ts_world world, ts_body body, const ts_pull* pull, ts_grab* grab) {
  return guarded([&] {
    const Turn turn(world);
    sized(pull, "pull");
    given(grab, "grab");
    if (std::isnan(pull->max_force)) fail(TS_ERROR_ARGUMENT, "max_force is not a number");
    *grab = turn->grab(turn->slot_of(body), pull->triangle, finite(pull->weights, 3, "weights"),
                       place(turn, pull->point, "point"), pull->frequency,
                       pull->max_force < 0.0 ? pull->max_force : turn.axes().length_in(pull->max_force));
  });
}

ts_result ts_world_get_grab(ts_world world, int32_t number, ts_grab* grab) {
  return guarded([&] {
    const Turn turn(world);
    *given(grab, "grab") = turn->grab_at(number);
  });
}

ts_result ts_grab_move(ts_world world, ts_grab grab, const double point[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->move_grab(grab, place(turn, point, "point"));
  });
}

ts_result ts_grab_release(ts_world world, ts_grab grab) {
  return guarded([&] { Turn(world)->release(grab); });
}

ts_result ts_grab_get_force(ts_world world, ts_grab grab, double force[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn.axes().place_out(turn->grab_force(grab), given(force, "force"));
  });
}

ts_result ts_body_join(ts_world world, ts_body body, const int32_t* vertices, size_t count, ts_body other,
                       const int32_t* onto, ts_joint* joint) {
  return guarded([&] {
    const Turn turn(world);
    given(joint, "joint");
    const int32_t slot = turn->slot_of(body);
    *joint = turn->join(slot, list(vertices, count), turn->slot_of(other), onto);
  });
}

ts_result ts_body_connect(ts_world world, ts_body body, ts_body other, int32_t kind, const double anchor[3],
                          const double axis[3], ts_joint* joint) {
  return guarded([&] {
    const Turn turn(world);
    given(joint, "joint");
    const Vector point = place(turn, anchor, "anchor");
    const Vector direction = turn.axes().normal_in(finite(axis, 3, "axis"));
    const int32_t slot = turn->slot_of(body);
    *joint = turn->connect(slot, turn->slot_of(other), kind, point, direction);
  });
}

ts_result ts_world_get_joint(ts_world world, int32_t number, ts_joint* joint) {
  return guarded([&] {
    const Turn turn(world);
    *given(joint, "joint") = turn->joint_at(number);
  });
}

ts_result ts_joint_release(ts_world world, ts_joint joint) {
  return guarded([&] { Turn(world)->release_joint(joint); });
}

ts_result ts_joint_set_break_force(ts_world world, ts_joint joint, double force) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_break_force(joint, turn.axes().length_in(force));
  });
}

ts_result ts_joint_get_force(ts_world world, ts_joint joint, double force[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn.axes().place_out(turn->joint_force(joint), given(force, "force"));
  });
}

ts_result ts_body_add_motor(ts_world world, ts_body body, const int32_t* vertices, size_t count, const ts_drive* drive,
                            ts_motor* motor) {
  return guarded([&] {
    const Turn turn(world);
    sized(drive, "drive");
    given(motor, "motor");
    *motor = turn->add_motor(turn->slot_of(body), list(vertices, count), drive_of(turn, *drive));
  });
}

ts_result ts_world_get_motor(ts_world world, int32_t number, ts_motor* motor) {
  return guarded([&] {
    const Turn turn(world);
    *given(motor, "motor") = turn->motor_at(number);
  });
}

ts_result ts_motor_set_speed(ts_world world, ts_motor motor, double speed) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_motor_speed(motor, motor_speed_in(turn, turn->turns(motor), speed));
  });
}

ts_result ts_motor_set_limit(ts_world world, ts_motor motor, double limit) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_motor_limit(motor, motor_limit_in(turn, turn->turns(motor), limit));
  });
}

ts_result ts_motor_remove(ts_world world, ts_motor motor) {
  return guarded([&] { Turn(world)->remove_motor(motor); });
}

ts_result ts_motor_get_speed(ts_world world, ts_motor motor, double* speed) {
  return guarded([&] {
    const Turn turn(world);
    given(speed, "speed");
    *speed = turn->motor_speed(motor) * (turn->turns(motor) ? 1.0 : turn.axes().scale());
  });
}

ts_result ts_motor_get_effort(ts_world world, ts_motor motor, double* effort) {
  return guarded([&] {
    const Turn turn(world);
    given(effort, "effort");
    const double scale = turn.axes().scale();
    *effort = turn->motor_effort(motor) * (turn->turns(motor) ? scale * scale : scale);
  });
}

ts_result ts_world_raycast(ts_world world, const double origin[3], const double direction[3], double reach,
                           ts_hit* hit) {
  return guarded([&] {
    const Turn turn(world);
    sized(hit, "hit");
    const Vector way = turn.axes().place_in(finite(direction, 3, "direction"));
    write_hit(turn, turn->first_hit(place(turn, origin, "origin"), way, as_reach(turn, reach)), hit);
  });
}

ts_result ts_world_closest(ts_world world, const double point[3], double reach, ts_hit* hit) {
  return guarded([&] {
    const Turn turn(world);
    sized(hit, "hit");
    write_hit(turn, turn->closest(place(turn, point, "point"), as_reach(turn, reach)), hit);
  });
}

ts_result ts_world_cast(ts_world world, const ts_cast* cast, ts_touch* touch) {
  return guarded([&] {
    const Turn turn(world);
    sized(cast, "cast");
    sized(touch, "touch");
    Cast asked{};
    asked.kind = cast->shape;
    asked.pose = {place(turn, cast->pose.position, "position"), {0.0, 0.0, 0.0, 1.0}};
    if (cast->shape != TS_RAY) {
      Collider shape{};
      const double* size = cast->size;
      const ts_shape given = {0, cast->shape, {size[0], size[1], size[2]}, 0.0, 0.0, 0.0, 1, 1};
      fill_shape(turn, given, &shape);
      std::copy(shape.parameters, shape.parameters + 8, asked.parameters);
      asked.pose = pose(turn, &cast->pose);
    }
    asked.direction = turn.axes().place_in(finite(cast->direction, 3, "direction"));
    asked.reach = as_reach(turn, cast->reach);
    asked.targets = as_targets(cast->targets);
    asked.mask = cast->mask;
    write_touch(turn, turn->cast(asked), touch);
  });
}

ts_result ts_world_nearest(ts_world world, const double point[3], double reach, int32_t targets, int32_t mask,
                           ts_touch* touch) {
  return guarded([&] {
    const Turn turn(world);
    sized(touch, "touch");
    write_touch(turn, turn->nearest(place(turn, point, "point"), as_reach(turn, reach), as_targets(targets), mask),
                touch);
  });
}

ts_result ts_world_overlap_sphere(ts_world world, const double center[3], double radius, ts_body* bodies,
                                  size_t capacity, size_t* count) {
  return guarded([&] {
    const Turn turn(world);
    given(count, "count");
    const double size = length(turn, radius, 1e-9, "radius");
    const Pose around = {place(turn, center, "center"), {0.0, 0.0, 0.0, 1.0}};
    write_overlaps(turn, turn->overlaps(false, around, {size, size, size}), bodies, capacity, count);
  });
}

ts_result ts_world_overlap_box(ts_world world, const ts_pose* where, const double size[3], ts_body* bodies,
                               size_t capacity, size_t* count) {
  return guarded([&] {
    const Turn turn(world);
    given(count, "count");
    Vector edges = turn.axes().place_in(finite(size, 3, "size"));
    for (int k = 0; k < 3; ++k) {
      length(turn, size[k], 1e-9, "size");
      edges[k] = std::fabs(edges[k]);
    }
    write_overlaps(turn, turn->overlaps(true, frame_pose(turn, where), edges), bodies, capacity, count);
  });
}

ts_result ts_collider_add(ts_world world, const ts_shape* shape, const ts_pose* where, int32_t* collider) {
  return guarded([&] {
    const Turn turn(world);
    sized(shape, "shape");
    given(collider, "collider");
    Collider row{};
    row.is_alive = true;
    row.pose = pose(turn, where);
    fill_shape(turn, *shape, &row);
    *collider = turn->add_collider(row);
  });
}

ts_result ts_sensor_add(ts_world world, const ts_shape* shape, const ts_pose* where, int32_t* sensor) {
  return guarded([&] {
    const Turn turn(world);
    ts_shape plain = *sized(shape, "shape");
    given(sensor, "sensor");
    plain.friction = 0.5, plain.restitution = -1.0, plain.thickness = 0.0;
    Collider row{};
    row.is_alive = row.is_sensor = true;
    fill_shape(turn, plain, &row);
    row.skin = 0.0;
    row.pose = pose(turn, where);
    *sensor = turn->add_collider(row);
  });
}

ts_result ts_sensor_get_bodies(ts_world world, int32_t sensor, ts_body* bodies, size_t capacity, size_t* count) {
  return guarded([&] {
    const Turn turn(world);
    given(count, "count");
    write_overlaps(turn, turn->bodies_inside(sensor), bodies, capacity, count);
  });
}

ts_result ts_collider_remove(ts_world world, int32_t collider) {
  return guarded([&] { Turn(world)->remove_collider(collider); });
}

ts_result ts_collider_move_to(ts_world world, int32_t collider, const ts_pose* where) {
  return guarded([&] {
    const Turn turn(world);
    turn->move_collider(collider, pose(turn, where));
  });
}

ts_result ts_collider_set_velocity(ts_world world, int32_t collider, const double linear[3], const double turning[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_collider_velocity(collider, vector(turn, linear, "linear"), spin(turn, turning, "spin"));
  });
}

ts_result ts_collider_set_filter(ts_world world, int32_t collider, int32_t group, int32_t mask) {
  return guarded([&] { Turn(world)->set_collider_filter(collider, group, mask); });
}

ts_result ts_collider_set_surface_velocity(ts_world world, int32_t collider, const double velocity[3]) {
  return guarded([&] {
    const Turn turn(world);
    turn->set_surface_velocity(collider, vector(turn, velocity, "velocity"));
  });
}

ts_result ts_collider_teleport(ts_world world, int32_t collider, const ts_pose* where) {
  return guarded([&] {
    const Turn turn(world);
    turn->teleport_collider(collider, pose(turn, where));
  });
}

ts_result ts_collider_set_friction(ts_world world, int32_t collider, double friction) {
  return guarded([&] { Turn(world)->set_collider_friction(collider, friction); });
}

ts_result ts_collider_get_pose(ts_world world, int32_t collider, ts_pose* where) {
  return guarded([&] {
    const Turn turn(world);
    given(where, "pose");
    const Pose& found = turn->collider(collider).pose;
    turn.axes().place_out(found.position, where->position);
    turn.axes().rotation_out(found.rotation, where->rotation);
  });
}

ts_result ts_collider_get_impulse(ts_world world, int32_t collider, double impulse[3], double moment[3]) {
  return guarded([&] {
    const Turn turn(world);
    Vector found, about;
    turn->collider_impulse(collider, &found, &about);
    if (impulse != nullptr) turn.axes().place_out(found, impulse);
    if (moment != nullptr) turn.axes().moment_out(about, moment);
  });
}

ts_result ts_frame_add(ts_world world, const ts_pose* where, int32_t* frame) {
  return guarded([&] {
    const Turn turn(world);
    given(frame, "frame");
    *frame = turn->add_frame(frame_pose(turn, where));
  });
}

ts_result ts_frame_remove(ts_world world, int32_t frame) {
  return guarded([&] { Turn(world)->remove_frame(frame); });
}

ts_result ts_frame_move_to(ts_world world, int32_t frame, const ts_pose* where) {
  return guarded([&] {
    const Turn turn(world);
    turn->move_frame(frame, frame_pose(turn, where));
  });
}

ts_result ts_frame_get_pose(ts_world world, int32_t frame, ts_pose* where) {
  return guarded([&] {
    const Turn turn(world);
    given(where, "pose");
    const Pose found = turn->frame_pose(frame);
    turn.axes().place_out(found.position, where->position);
    turn.axes().rotation_out(found.rotation, where->rotation);
  });
}

}  // extern "C"
