// taichi_soft.h for C++17: handles with RAII, and errors as exceptions. To call a C function that has no method here,
// pass `handle()`.
//
//     auto scene = taichi_soft::Scene("game.softworld");
//     auto world = scene.create();
//     world.advance(1.0 / 60.0);
//     world.mesh(body, mesh, positions, normals);
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "taichi_soft.h"

namespace taichi_soft {

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // x, y, z, w

class Error : public std::runtime_error {
 public:
  explicit Error(ts_result code) : std::runtime_error(ts_last_error()), code(code) {}
  ts_result code;
};

inline void check(ts_result result) {
  if (result != TS_OK) throw Error(result);
}

struct Pose {
  Vector position{};
  Quaternion rotation{0.0, 0.0, 0.0, 1.0};

  ts_pose plain() const {
    ts_pose found;
    for (int i = 0; i < 3; ++i) found.position[i] = position[i];
    for (int i = 0; i < 4; ++i) found.rotation[i] = rotation[i];
    return found;
  }
  static Pose of(const ts_pose& plain) {
    Pose found;
    for (int i = 0; i < 3; ++i) found.position[i] = plain.position[i];
    for (int i = 0; i < 4; ++i) found.rotation[i] = plain.rotation[i];
    return found;
  }
};

// A body of a world: a small value that can be copied. Calls with a removed body are refused.
struct Body {
  ts_body handle = 0;
  explicit operator bool() const { return handle != 0; }
};

// Joint between two bodies, and motor on a part of a body: small values that can be copied.
struct Joint {
  ts_joint handle = 0;
  explicit operator bool() const { return handle != 0; }
};
struct Motor {
  ts_motor handle = 0;
  explicit operator bool() const { return handle != 0; }
};

// A grab, from `World::grab`, which the destructor releases. A Grab can be moved, but not copied. After a
// `World::restore` to a time before the grab, a new grab can get the same handle. So first destroy the Grab or call
// `forget`.
class Grab {
 public:
  Grab() = default;
  // Takes ownership of an existing grab, for example from `ts_world_get_grab`.
  Grab(ts_world world, ts_grab handle) : world_(world), handle_(handle) {}
  Grab(Grab&& other) noexcept { swap(other); }
  Grab& operator=(Grab&& other) noexcept {
    if (this == &other) return *this;
    // After a restore, the new grab can have the same handle. Do not release this handle.
    if (handle_ != other.handle_ || world_ != other.world_) end();
    forget();
    swap(other);
    return *this;
  }
  Grab(const Grab&) = delete;
  Grab& operator=(const Grab&) = delete;
  ~Grab() { end(); }

  ts_grab handle() const { return handle_; }
  explicit operator bool() const { return handle_ != 0; }

  void move(const Vector& point) { check(ts_grab_move(world_, handle_, point.data())); }
  // Force of the grab in the last substep [N].
  Vector force() const {
    Vector found;
    check(ts_grab_get_force(world_, handle_, found.data()));
    return found;
  }
  // Releases the grab.
  void release() {
    check(ts_grab_release(world_, handle_));
    handle_ = 0;
  }
  // Gives up ownership, without releasing the grab.
  void forget() { handle_ = 0; }

 private:
  void end() noexcept {
    if (handle_ != 0) ts_grab_release(world_, handle_);  // an error means that the world or the body was removed
  }
  void swap(Grab& other) noexcept {
    std::swap(world_, other.world_);
    std::swap(handle_, other.handle_);
  }

  ts_world world_ = 0;
  ts_grab handle_ = 0;
};

// A running instance of a scene. A World can be moved, but not copied.
class World {
 public:
  explicit World(ts_scene scene) {
    ts_scene_info info{};
    info.struct_size = sizeof info;
    check(ts_scene_get_info(scene, &info));
    slot_count_ = info.slot_count;
    check(ts_world_create(scene, &handle_));
  }
  World(World&& other) noexcept { swap(other); }
  World& operator=(World&& other) noexcept {
    swap(other);
    return *this;
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World() {
    if (handle_ != 0) ts_world_destroy(handle_);
  }

  ts_world handle() const { return handle_; }

  void step(double dt, int32_t substeps = 0) { check(ts_world_step(handle_, dt, substeps)); }
  ts_clock advance(double seconds) {
    ts_clock clock{sizeof(ts_clock), 0, 0, 0.0, 0.0, 0.0};
    check(ts_world_advance(handle_, seconds, &clock));
    return clock;
  }
  void set_fixed_step(double dt, int32_t substeps = 0, int32_t max_steps = 8) {
    const ts_fixed_step step{sizeof(ts_fixed_step), substeps, max_steps, dt};
    check(ts_world_set_fixed_step(handle_, &step));
  }
  // Sets the number of threads for a step, including the calling thread.
  void set_threads(int32_t count) { check(ts_world_set_threads(handle_, count)); }
  // Sets a function that `advance` calls before each step. The function must not throw or call `on_step`.
  void on_step(std::function<void()> function) {
    auto next = std::make_unique<std::function<void()>>(std::move(function));
    const ts_before_step call = [](ts_world, void* user) { (*static_cast<std::function<void()>*>(user))(); };
    check(ts_world_on_step(handle_, *next ? call : nullptr, next.get()));
    before_ = std::move(next);  // after the library has stopped using the old function
  }
  // Move the origin: subtract `offset` from all coordinates.
  void shift_origin(const Vector& offset) { check(ts_world_shift_origin(handle_, offset.data())); }
  void set_view_origin(const Vector& point) { check(ts_world_set_view_origin(handle_, point.data())); }
  // Set the friction of the floor, of a body in contact with other bodies, or of a collider.
  void set_friction(double friction) { check(ts_world_set_friction(handle_, friction)); }
  void set_friction(Body body, double friction) { check(ts_body_set_friction(handle_, body.handle, friction)); }
  void set_collider_friction(int32_t collider, double friction) {
    check(ts_collider_set_friction(handle_, collider, friction));
  }
  // Set group and mask of a body, or of a collider.
  void set_filter(Body body, int32_t group, int32_t mask) {
    check(ts_body_set_filter(handle_, body.handle, group, mask));
  }
  void set_collider_filter(int32_t collider, int32_t group, int32_t mask) {
    check(ts_collider_set_filter(handle_, collider, group, mask));
  }
  // Sets gravity [m/s^2].
  void set_gravity(const Vector& gravity) { check(ts_world_set_gravity(handle_, gravity.data())); }
  uint64_t hash() const {
    uint64_t found = 0;
    check(ts_world_hash(handle_, &found));
    return found;
  }
  std::vector<char> snapshot() const {
    size_t size = 0;
    check(ts_world_snapshot(handle_, nullptr, 0, &size));
    std::vector<char> bytes(size);
    check(ts_world_snapshot(handle_, bytes.data(), bytes.size(), &size));
    return bytes;
  }
  void restore(const std::vector<char>& bytes) { check(ts_world_restore(handle_, bytes.data(), bytes.size())); }

  // Records events of these kinds from the next step on. `kinds` is a sum of bits such as TS_CONTACT_BEGAN; 0 is none.
  void record_events(int32_t kinds) { check(ts_world_record_events(handle_, kinds)); }
  // Replaces the contents of `events` by all waiting events. Reuse the vector between frames to avoid allocations.
  void drain_events(std::vector<ts_event>& events) {
    std::array<ts_event, 64> some;
    size_t count = some.size();
    events.clear();
    while (count == some.size()) {
      check(ts_world_drain_events(handle_, some.data(), sizeof(ts_event), some.size(), &count));
      events.insert(events.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
    }
  }
  int64_t dropped_events() const {
    int64_t found = 0;
    check(ts_world_dropped_events(handle_, &found));
    return found;
  }

  Body body(int32_t slot) const {
    Body found;
    check(ts_world_get_body(handle_, slot, &found.handle));
    return found;
  }
  Body spawn(int32_t asset, const Pose& pose, const Vector& velocity = {}, const Vector& spin = {}) {
    ts_placement place{};
    place.struct_size = sizeof place;
    for (int i = 0; i < 3; ++i) {
      place.position[i] = pose.position[i];
      place.velocity[i] = velocity[i];
      place.spin[i] = spin[i];
    }
    for (int i = 0; i < 4; ++i) place.rotation[i] = pose.rotation[i];
    Body found;
    check(ts_world_spawn(handle_, asset, &place, &found.handle));
    return found;
  }
  void despawn(Body body) { check(ts_world_despawn(handle_, body.handle)); }
  // Switches a body off or on, see ts_body_set_enabled.
  void set_enabled(Body body, bool is_enabled) { check(ts_body_set_enabled(handle_, body.handle, is_enabled ? 1 : 0)); }
  int32_t status(Body body) const {
    int32_t found = 0;
    check(ts_body_get_status(handle_, body.handle, &found));
    return found;
  }
  Vector center(Body body) const {
    Vector found;
    check(ts_body_center(handle_, body.handle, found.data()));
    return found;
  }
  // Changes the level of detail; 0 is the finest, see ts_body_set_level.
  void set_level(Body body, int32_t level, bool release = false) {
    check(ts_body_set_level(handle_, body.handle, level, release ? 1 : 0));
  }
  int32_t level(Body body) const {
    int32_t found = 0;
    check(ts_body_get_level(handle_, body.handle, &found));
    return found;
  }
  // Number of vertices at the body's level.
  int32_t vertex_count(Body body) const {
    int32_t found = 0;
    check(ts_body_get_vertex_count(handle_, body.handle, &found));
    return found;
  }
  // Reads the positions of all vertices, 3 numbers each.
  void positions(Body body, std::vector<float>& out, double alpha = 1.0) const {
    check(ts_body_positions(handle_, body.handle, alpha, out.data(), out.size()));
  }
  void mesh(Body body, int32_t mesh, std::vector<float>& positions, std::vector<float>& normals) const {
    if (positions.size() != normals.size()) throw std::invalid_argument("positions and normals differ in size");
    check(ts_body_mesh(handle_, body.handle, mesh, positions.data(), normals.data(), positions.size()));
  }
  void set_velocity(Body body, const Vector& linear, const Vector& spin = {}) {
    check(ts_body_set_velocity(handle_, body.handle, linear.data(), spin.data()));
  }
  // Applies an impulse to the vertices in a list; an empty list means all vertices.
  void apply_impulse(Body body, const Vector& impulse, const std::vector<int32_t>& vertices = {}) {
    check(ts_body_apply_impulse(handle_, body.handle, impulse.data(), vertices.data(), vertices.size()));
  }
  void apply_force(Body body, const Vector& force, const std::vector<int32_t>& vertices = {}) {
    check(ts_body_apply_force(handle_, body.handle, force.data(), vertices.data(), vertices.size()));
  }

  // Attaches vertices to a frame; set `feels` to use `load` later.
  void attach(Body body, const std::vector<int32_t>& vertices, int32_t frame, bool feels = false) {
    check(ts_body_attach(handle_, body.handle, vertices.data(), vertices.size(), frame, feels ? 1 : 0));
  }
  // Detaches the vertices in a list; an empty list means all attached vertices.
  void detach(Body body, const std::vector<int32_t>& vertices = {}) {
    check(ts_body_detach(handle_, body.handle, vertices.data(), vertices.size()));
  }
  // Mean force on a frame in the last step [N], and mean torque about the frame's origin.
  std::pair<Vector, Vector> load(Body body, int32_t frame) const {
    std::pair<Vector, Vector> found;
    check(ts_body_get_load(handle_, body.handle, frame, found.first.data(), found.second.data()));
    return found;
  }
  // Grabs a body at the point that a ray hit. A `max_force` below 0 means ten times the body's weight on Earth.
  Grab grab(const ts_hit& hit, double frequency = 5.0, double max_force = -1.0) {
    ts_pull pull{};
    pull.struct_size = sizeof pull;
    pull.triangle = hit.triangle;
    for (int i = 0; i < 3; ++i) {
      pull.weights[i] = hit.weights[i];
      pull.point[i] = hit.point[i];
    }
    pull.frequency = frequency;
    pull.max_force = max_force;
    ts_grab found = 0;
    check(ts_body_grab(handle_, hit.body, &pull, &found));
    return Grab(handle_, found);
  }

  // Attaches vertices to `other` at their current positions or, if `onto` is not empty, each to a vertex in `onto`.
  Joint join(Body body, const std::vector<int32_t>& vertices, Body other, const std::vector<int32_t>& onto = {}) {
    if (!onto.empty() && onto.size() != vertices.size()) throw std::invalid_argument("onto differs in size");
    Joint found;
    check(ts_body_join(handle_, body.handle, vertices.data(), vertices.size(), other.handle,
                       onto.empty() ? nullptr : onto.data(), &found.handle));
    return found;
  }
  // Connects a rigid body to `other`: `kind` is one of TS_JOINT_BALL, _HINGE, _SLIDER and _FIXED.
  Joint connect(Body body, Body other, int32_t kind, const Vector& anchor, const Vector& axis = {0.0, 0.0, 1.0}) {
    Joint found;
    check(ts_body_connect(handle_, body.handle, other.handle, kind, anchor.data(), axis.data(), &found.handle));
    return found;
  }
  void release(Joint joint) { check(ts_joint_release(handle_, joint.handle)); }
  // Mean force of a step above which the joint breaks [N]; 0 for never.
  void set_break_force(Joint joint, double force) { check(ts_joint_set_break_force(handle_, joint.handle, force)); }
  // Mean force of the other body in the last step [N].
  Vector force(Joint joint) const {
    Vector found;
    check(ts_joint_get_force(handle_, joint.handle, found.data()));
    return found;
  }
  Motor add_motor(Body body, const std::vector<int32_t>& vertices, ts_drive drive) {
    Motor found;
    drive.struct_size = sizeof drive;
    check(ts_body_add_motor(handle_, body.handle, vertices.data(), vertices.size(), &drive, &found.handle));
    return found;
  }
  void set_speed(Motor motor, double speed) { check(ts_motor_set_speed(handle_, motor.handle, speed)); }
  void set_limit(Motor motor, double limit) { check(ts_motor_set_limit(handle_, motor.handle, limit)); }
  void remove(Motor motor) { check(ts_motor_remove(handle_, motor.handle)); }

  // First surface that a ray hits from outside. The hit's body is 0 if the ray hits nothing.
  ts_hit raycast(const Vector& origin, const Vector& direction, double max_distance = HUGE_VAL) const {
    ts_hit found{};
    found.struct_size = sizeof found;
    check(ts_world_raycast(handle_, origin.data(), direction.data(), max_distance, &found));
    return found;
  }
  ts_hit closest(const Vector& point, double max_distance = HUGE_VAL) const {
    ts_hit found{};
    found.struct_size = sizeof found;
    check(ts_world_closest(handle_, point.data(), max_distance, &found));
    return found;
  }

  // First touch of a ray or of a moving shape. If nothing is touched, `body` is 0 and `collider` is -1.
  ts_touch cast(ts_cast cast) const {
    ts_touch found{};
    found.struct_size = sizeof found;
    cast.struct_size = sizeof cast;
    check(ts_world_cast(handle_, &cast, &found));
    return found;
  }
  ts_touch nearest(const Vector& point, double max_distance = HUGE_VAL, int32_t targets = TS_BODIES | TS_COLLIDERS,
                   int32_t mask = -1) const {
    ts_touch found{};
    found.struct_size = sizeof found;
    check(ts_world_nearest(handle_, point.data(), max_distance, targets, mask, &found));
    return found;
  }

  // Bodies that touch or enclose a sphere, or a box with edges of `size`, in the order of slots.
  std::vector<Body> overlap_sphere(const Vector& center, double radius) const {
    return overlap([&](ts_body* bodies, size_t capacity, size_t* count) {
      return ts_world_overlap_sphere(handle_, center.data(), radius, bodies, capacity, count);
    });
  }
  std::vector<Body> overlap_box(const Pose& pose, const Vector& size) const {
    const ts_pose plain = pose.plain();
    return overlap([&](ts_body* bodies, size_t capacity, size_t* count) {
      return ts_world_overlap_box(handle_, &plain, size.data(), bodies, capacity, count);
    });
  }

  void move_collider(int32_t collider, const Pose& pose) {
    const ts_pose plain = pose.plain();
    check(ts_collider_move_to(handle_, collider, &plain));
  }
  // Bodies that touch or enclose a sensor, see ts_sensor_add.
  std::vector<Body> bodies_inside(int32_t sensor) const {
    return overlap([&](ts_body* bodies, size_t capacity, size_t* count) {
      return ts_sensor_get_bodies(handle_, sensor, bodies, capacity, count);
    });
  }
  // Moves the surface of a collider like a conveyor belt, see ts_collider_set_surface_velocity.
  void set_surface_velocity(int32_t collider, const Vector& velocity) {
    check(ts_collider_set_surface_velocity(handle_, collider, velocity.data()));
  }
  // Impulse of all bodies on a collider in the last step, and angular impulse about the collider's position.
  std::pair<Vector, Vector> collider_impulse(int32_t collider) const {
    std::pair<Vector, Vector> found;
    check(ts_collider_get_impulse(handle_, collider, found.first.data(), found.second.data()));
    return found;
  }
  // Adds a frame, a pose that the game moves. Returns: number of the frame.
  int32_t add_frame(const Pose& pose) {
    const ts_pose plain = pose.plain();
    int32_t found = 0;
    check(ts_frame_add(handle_, &plain, &found));
    return found;
  }
  // Removes a frame and detaches its vertices.
  void remove_frame(int32_t frame) { check(ts_frame_remove(handle_, frame)); }
  Pose frame_pose(int32_t frame) const {
    ts_pose plain{};
    check(ts_frame_get_pose(handle_, frame, &plain));
    return Pose::of(plain);
  }
  void move_frame(int32_t frame, const Pose& pose) {
    const ts_pose plain = pose.plain();
    check(ts_frame_move_to(handle_, frame, &plain));
  }

 private:
  void swap(World& other) noexcept {
    std::swap(handle_, other.handle_);
    std::swap(before_, other.before_);
    std::swap(slot_count_, other.slot_count_);
  }
  template <typename Call>
  std::vector<Body> overlap(Call call) const {
    std::vector<ts_body> bodies(static_cast<size_t>(slot_count_));
    size_t count = 0;
    check(call(bodies.data(), bodies.size(), &count));
    std::vector<Body> found;
    for (size_t i = 0; i < count; ++i) found.push_back(Body{bodies[i]});
    return found;
  }

  ts_world handle_ = 0;
  int32_t slot_count_ = 0;
  std::unique_ptr<std::function<void()>> before_;  // its address stays valid when the World is moved
};

// A world file in memory.
class Scene {
 public:
  explicit Scene(const std::string& folder) { check(ts_scene_load(folder.c_str(), &handle_)); }
  Scene(Scene&& other) noexcept { std::swap(handle_, other.handle_); }
  Scene& operator=(Scene&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene() {
    if (handle_ != 0) ts_scene_unload(handle_);
  }

  ts_scene handle() const { return handle_; }
  World create() const { return World(handle_); }

  // Number of the object with a name. `kind` is TS_BODY, TS_ASSET or another kind of named objects.
  int32_t find(int32_t kind, const std::string& name) const {
    int32_t found = 0;
    check(ts_scene_find(handle_, kind, name.c_str(), &found));
    return found;
  }
  ts_mesh_info mesh(int32_t number) const {
    ts_mesh_info info{};
    info.struct_size = sizeof info;
    check(ts_mesh_get_info(handle_, number, &info));
    return info;
  }
  std::vector<uint32_t> triangles(int32_t mesh) const {
    std::vector<uint32_t> found(3 * size_t(this->mesh(mesh).triangle_count));
    check(ts_mesh_get_triangles(handle_, mesh, found.data(), found.size()));
    return found;
  }
  std::vector<float> uv(int32_t mesh) const {
    const ts_mesh_info info = this->mesh(mesh);
    std::vector<float> found(info.has_uv != 0 ? 2 * size_t(info.vertex_count) : 0);
    if (!found.empty()) check(ts_mesh_get_uv(handle_, mesh, found.data(), found.size()));
    return found;
  }

 private:
  ts_scene handle_ = 0;
};

}  // namespace taichi_soft
