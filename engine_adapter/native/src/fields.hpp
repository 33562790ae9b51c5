// Fields of a world, and the bounds of their numbers in snapshots. Written by engine_adapter/native/write_fields.py from the declarations
// in Python: do not edit.
// clang-format off
#pragma once

#include <limits>

#include "scene.hpp"

namespace taichi_soft {

// Numbers of a field in memory.
template <typename Number>
class Field {
 public:
  Field() = default;
  Field(char* root, const Place& place) : first_(root + place.offset), stride_(place.stride) {}
  Number& operator()(size_t i, size_t k = 0) const {
    return reinterpret_cast<Number*>(first_ + i * stride_)[k];
  }

 private:
  char* first_ = nullptr;
  size_t stride_ = 0;
};

struct Fields {
  Field<float> particle_position;
  Field<float> particle_local;
  Field<float> particle_velocity;
  Field<float> particle_mass;
  Field<float> particle_inv_mass;
  Field<int32_t> particle_aim;
  Field<float> particle_target;
  Field<float> particle_reaction;
  Field<float> rod_reaction;
  Field<int32_t> particle_contact;
  Field<int32_t> body_blocks;
  Field<int32_t> body_status;
  Field<float> body_velocity_lag;
  Field<float> body_origin;
  Field<float> body_surface;
  Field<int32_t> body_drives;
  Field<int32_t> body_filter;
  Field<float> body_gravity_scale;
  Field<float> body_damping;
  Field<float> gravity;
  Field<float> wind;
  Field<float> view_origin;
  Field<float> floor;
  struct {
    Field<int32_t> attempt;
    Field<int32_t> s;
    Field<int32_t> is_stable;
    Field<int32_t> failed;
    Field<int32_t> is_awake;
    Field<int32_t> candidates;
    Field<float> fastest;
    Field<float> velocity;
    Field<float> shift;
  } progress;
  struct {
    Field<int32_t> body;
    Field<int32_t> corners;
    Field<float> weights;
    Field<float> target;
    Field<float> residue;
    Field<float> spring;
    Field<float> limits;
    Field<float> force;
    Field<int32_t> count;
    Field<int32_t> particle;
    Field<float> share;
  } grabs;
  struct {
    struct {
      Field<int32_t> body;
      Field<int32_t> first;
      Field<int32_t> end;
      Field<int32_t> turns;
      Field<int32_t> is_fixed;
      Field<int32_t> has_point;
      Field<float> axis;
      Field<float> point;
      Field<float> speed;
      Field<float> limit;
    } motor;
    Field<int32_t> particle;
    Field<int32_t> is_driven;
    Field<float> impulse;
  } motors;
  struct {
    Field<int32_t> count;
  } islands;
  struct {
    Field<int32_t> count;
    Field<int32_t> kind;
    Field<float> parameters;
    Field<float> position;
    Field<float> position_residue;
    Field<float> rotation;
    Field<float> velocity;
    Field<float> spin;
    Field<float> surface;
    Field<float> surface_velocity;
    Field<int32_t> filter;
    Field<float> lower;
    Field<float> upper;
    Field<float> speed;
  } colliders;
  struct {
    Field<int32_t> bodies;
    Field<int32_t> rows;
    Field<float> impulse;
    Field<float> break_force;
  } joints;
  struct {
    Field<int32_t> records_touches;
  } soft;

  Fields() = default;
  // Fails if a field is missing, or too short.
  Fields(char* root, const Scene& scene, size_t collider_room) {
    const size_t bodies = size_t(scene.slot_count), particles = size_t(scene.particle_count);
    particle_position = {root, scene.place("particle_position", particles, 3)};
    particle_local = {root, scene.place("particle_local", particles, 3)};
    particle_velocity = {root, scene.place("particle_velocity", particles, 3)};
    particle_mass = {root, scene.place("particle_mass", particles, 1)};
    particle_inv_mass = {root, scene.place("particle_inv_mass", particles, 1)};
    particle_aim = {root, scene.place("particle_aim", particles, 1)};
    particle_target = {root, scene.place("particle_target", particles, 3)};
    particle_reaction = {root, scene.place("particle_reaction", particles, 3)};
    if (scene.has_rods) rod_reaction = {root, scene.place("rod_reaction", particles, 3)};
    if (scene.is_implicit) particle_contact = {root, scene.place("particle_contact", particles, 1)};
    body_blocks = {root, scene.place("body_blocks", bodies, 2)};
    body_status = {root, scene.place("body_status", bodies, 1)};
    body_velocity_lag = {root, scene.place("body_velocity_lag", bodies, 1)};
    body_origin = {root, scene.place("body_origin", bodies, 3)};
    body_surface = {root, scene.place("body_surface", bodies, 3)};
    body_drives = {root, scene.place("body_drives", bodies, 1)};
    body_filter = {root, scene.place("body_filter", bodies, 2)};
    body_gravity_scale = {root, scene.place("body_gravity_scale", bodies, 1)};
    body_damping = {root, scene.place("body_damping", bodies, 1)};
    gravity = {root, scene.place("gravity", 1, 3)};
    wind = {root, scene.place("wind", 1, 4)};
    view_origin = {root, scene.place("view_origin", 1, 6)};
    floor = {root, scene.place("floor", 1, 3)};
    progress.attempt = {root, scene.place("progress.attempt", bodies, 1)};
    progress.s = {root, scene.place("progress.s", bodies, 1)};
    progress.is_stable = {root, scene.place("progress.is_stable", bodies, 1)};
    progress.failed = {root, scene.place("progress.failed", bodies, 1)};
    progress.is_awake = {root, scene.place("progress.is_awake", bodies, 1)};
    progress.candidates = {root, scene.place("progress.candidates", bodies, 1)};
    progress.fastest = {root, scene.place("progress.fastest", bodies, 1)};
    progress.velocity = {root, scene.place("progress.velocity", bodies, 3)};
    progress.shift = {root, scene.place("progress.shift", bodies, 3)};
    grabs.body = {root, scene.place("grabs.body", 16, 1)};
    grabs.corners = {root, scene.place("grabs.corners", 16, 4)};
    grabs.weights = {root, scene.place("grabs.weights", 16, 4)};
    grabs.target = {root, scene.place("grabs.target", 16, 3)};
    grabs.residue = {root, scene.place("grabs.residue", 16, 3)};
    grabs.spring = {root, scene.place("grabs.spring", 16, 3)};
    grabs.limits = {root, scene.place("grabs.limits", 16, 3)};
    grabs.force = {root, scene.place("grabs.force", 16, 3)};
    grabs.count = {root, scene.place("grabs.count", 16, 1)};
    grabs.particle = {root, scene.place("grabs.particle", 2048, 1)};
    grabs.share = {root, scene.place("grabs.share", 2048, 1)};
    motors.motor.body = {root, scene.place("motors.motor.body", 64, 1)};
    motors.motor.first = {root, scene.place("motors.motor.first", 64, 1)};
    motors.motor.end = {root, scene.place("motors.motor.end", 64, 1)};
    motors.motor.turns = {root, scene.place("motors.motor.turns", 64, 1)};
    motors.motor.is_fixed = {root, scene.place("motors.motor.is_fixed", 64, 1)};
    motors.motor.has_point = {root, scene.place("motors.motor.has_point", 64, 1)};
    motors.motor.axis = {root, scene.place("motors.motor.axis", 64, 3)};
    motors.motor.point = {root, scene.place("motors.motor.point", 64, 3)};
    motors.motor.speed = {root, scene.place("motors.motor.speed", 64, 1)};
    motors.motor.limit = {root, scene.place("motors.motor.limit", 64, 1)};
    motors.particle = {root, scene.place("motors.particle", 16384, 1)};
    motors.is_driven = {root, scene.place("motors.is_driven", bodies, 1)};
    motors.impulse = {root, scene.place("motors.impulse", 64, 1)};
    islands.count = {root, scene.place("islands.count", 1, 1)};
    colliders.count = {root, scene.place("colliders.count", 1, 1)};
    colliders.kind = {root, scene.place("colliders.kind", collider_room, 1)};
    colliders.parameters = {root, scene.place("colliders.parameters", collider_room, 8)};
    colliders.position = {root, scene.place("colliders.position", collider_room, 3)};
    colliders.position_residue = {root, scene.place("colliders.position_residue", collider_room, 3)};
    colliders.rotation = {root, scene.place("colliders.rotation", collider_room, 4)};
    colliders.velocity = {root, scene.place("colliders.velocity", collider_room, 3)};
    colliders.spin = {root, scene.place("colliders.spin", collider_room, 3)};
    colliders.surface = {root, scene.place("colliders.surface", collider_room, 3)};
    colliders.surface_velocity = {root, scene.place("colliders.surface_velocity", collider_room, 3)};
    colliders.filter = {root, scene.place("colliders.filter", collider_room, 2)};
    colliders.lower = {root, scene.place("colliders.lower", collider_room, 3)};
    colliders.upper = {root, scene.place("colliders.upper", collider_room, 3)};
    colliders.speed = {root, scene.place("colliders.speed", collider_room, 1)};
    joints.bodies = {root, scene.place("joints.bodies", 64, 2)};
    joints.rows = {root, scene.place("joints.rows", 64, 2)};
    joints.impulse = {root, scene.place("joints.impulse", 64, 3)};
    joints.break_force = {root, scene.place("joints.break_force", 64, 1)};
    if (scene.has_soft_contact) soft.records_touches = {root, scene.place("soft.records_touches", 1, 1)};
  }
};

// Bounds of a field. Integers are at least 0 and less than the number of `things` plus `beside`. The absolute
// values of floats are at most `most`; infinity means no bound.
struct Bound {
  enum Things { kNothing, kParticles, kBodies, kColliders, kFrames };
  const char* field;
  Things things;
  int beside;
  float most;
};

constexpr float kAny = std::numeric_limits<float>::infinity(), kFinite = std::numeric_limits<float>::max();
constexpr Bound kBounds[] = {
    {"particle_position", Bound::kNothing, 0, 1.0e+07f},
    {"particle_local", Bound::kNothing, 0, kFinite},
    {"particle_velocity", Bound::kNothing, 0, kFinite},
    {"particle_mass", Bound::kNothing, 0, kFinite},
    {"particle_inv_mass", Bound::kNothing, 0, kFinite},
    {"prev_position", Bound::kNothing, 0, kFinite},
    {"prev_velocity", Bound::kNothing, 0, kFinite},
    {"particle_aim", Bound::kFrames, 3, kAny},
    {"particle_target", Bound::kNothing, 0, kFinite},
    {"particle_push", Bound::kNothing, 0, kFinite},
    {"tet_rest_inverse", Bound::kNothing, 0, kFinite},
    {"rod_frame", Bound::kNothing, 0, kFinite},
    {"rod_spin", Bound::kNothing, 0, kFinite},
    {"particle_contact", Bound::kColliders, 1, kAny},
    {"body_status", Bound::kNothing, 7, kAny},
    {"body_velocity_lag", Bound::kNothing, 0, kFinite},
    {"body_origin", Bound::kNothing, 0, 1.0e+07f},
    {"body_gravity_scale", Bound::kNothing, 0, kFinite},
    {"body_damping", Bound::kNothing, 0, kFinite},
    {"body_refinement", Bound::kNothing, 0, kFinite},
    {"body_sound_speed", Bound::kNothing, 0, kFinite},
    {"wind", Bound::kNothing, 0, kFinite},
    {"grabs.body", Bound::kBodies, 1, kAny},
    {"grabs.corners", Bound::kParticles, 0, kAny},
    {"grabs.weights", Bound::kNothing, 0, kFinite},
    {"grabs.target", Bound::kNothing, 0, kFinite},
    {"grabs.residue", Bound::kNothing, 0, kFinite},
    {"grabs.spring", Bound::kNothing, 0, kFinite},
    {"grabs.limits", Bound::kNothing, 0, kFinite},
    {"grabs.count", Bound::kNothing, 129, kAny},
    {"grabs.particle", Bound::kParticles, 0, kAny},
    {"grabs.share", Bound::kNothing, 0, kFinite},
    {"motors.motor.body", Bound::kBodies, 1, kFinite},
    {"motors.motor.axis", Bound::kNothing, 0, kFinite},
    {"motors.motor.point", Bound::kNothing, 0, kFinite},
    {"motors.motor.speed", Bound::kNothing, 0, kFinite},
    {"motors.motor.limit", Bound::kNothing, 0, kFinite},
    {"motors.particle", Bound::kParticles, 0, kAny},
    {"motors.impulse", Bound::kNothing, 0, kFinite},
    {"joints.bodies", Bound::kBodies, 1, kAny},
    {"joints.rows", Bound::kNothing, 2049, kAny},
    {"joints.draw_speed", Bound::kNothing, 0, kFinite},
    {"joints.break_force", Bound::kNothing, 0, kFinite},
    {"joints.particle", Bound::kParticles, 0, kAny},
    {"joints.weight", Bound::kNothing, 0, 1.0e+03f},
    {"joints.axis", Bound::kNothing, 0, kFinite},
    {"soft.kept_normal_impulse", Bound::kNothing, 0, 1.0e+30f},
    {"soft.kept_friction_impulse", Bound::kNothing, 0, 1.0e+30f},
    {"soft.kept_edge_normal_impulse", Bound::kNothing, 0, 1.0e+30f},
    {"soft.kept_edge_friction_impulse", Bound::kNothing, 0, 1.0e+30f},
    {"rigid.center", Bound::kNothing, 0, kFinite},
    {"rigid.rotation", Bound::kNothing, 0, kFinite},
    {"rigid.residue", Bound::kNothing, 0, kFinite},
};

}  // namespace taichi_soft
