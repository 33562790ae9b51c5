#include "world_native.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "taichi_soft.hpp"

namespace taichi_soft_godot {

using taichi_soft::check;

void WorldNative::clear() {
  if (world != 0) ts_world_destroy(world);
  if (scene != 0) ts_scene_unload(scene);
  scene = 0, world = 0;
}

namespace {

using Self = WorldNative&;
using In = const Arguments&;

ts_body body_of(In in) { return ts_body(in.whole(0)); }

ts_scene_info info_of(Self self) {
  ts_scene_info info{};
  info.struct_size = sizeof info;
  check(ts_scene_get_info(self.scene, &info));
  return info;
}

ts_mesh_info mesh_of(Self self, int32_t mesh) {
  ts_mesh_info info{};
  info.struct_size = sizeof info;
  check(ts_mesh_get_info(self.scene, mesh, &info));
  return info;
}

// ---- the world file ----

Variant load(Self self, In in) {
  self.clear();
  check(ts_scene_load(in.text(0).c_str(), &self.scene));
  const ts_result created = ts_world_create(self.scene, &self.world);
  if (created != TS_OK) {
    const taichi_soft::Error error(created);  // copied before `clear`, whose calls may replace the last error
    self.clear();
    throw error;
  }
  return of(true);
}

Variant unload(Self self, In) {
  self.clear();
  return of(true);
}

Variant count(Self self, In in) {
  const ts_scene_info info = info_of(self);
  const int32_t kind = in.small(0);
  const int32_t counts[] = {info.slot_count, info.asset_count, info.collider_count, info.frame_count, info.mesh_count};
  if (kind < 0 || kind > TS_MESH) throw Refused("argument 1 is " + std::to_string(kind) + ": give a kind from 0 to 4");
  return of(int64_t(counts[kind]));
}

Variant find(Self self, In in) {
  int32_t number = 0;
  check(ts_scene_find(self.scene, in.small(0), in.text(1).c_str(), &number));
  return of(int64_t(number));
}

Variant name_of(Self self, In in) {
  char name[256] = "";
  check(ts_scene_get_name(self.scene, in.small(0), in.small(1), name, sizeof name));
  return of(std::string(name));
}

// Returns the asset, the numbers of vertices and triangles, true if there are texture coordinates, and the level of
// detail (-1 for a skin).
Variant mesh_info(Self self, In in) {
  const ts_mesh_info info = mesh_of(self, in.small(0));
  int32_t level = 0;
  check(ts_mesh_get_level(self.scene, in.small(0), &level));
  return of_whole_numbers({info.asset, info.vertex_count, info.triangle_count, info.has_uv, level});
}

Variant triangles(Self self, In in) {
  std::vector<uint32_t> found(3 * size_t(mesh_of(self, in.small(0)).triangle_count));
  check(ts_mesh_get_triangles(self.scene, in.small(0), found.data(), found.size()));
  // Front faces are clockwise in Godot.
  std::vector<int32_t> clockwise(found.size());
  for (size_t i = 0; i + 2 < found.size(); i += 3) {
    clockwise[i] = int32_t(found[i]), clockwise[i + 1] = int32_t(found[i + 2]), clockwise[i + 2] = int32_t(found[i + 1]);
  }
  return of_whole_numbers(clockwise);
}

Variant uvs(Self self, In in) {
  const ts_mesh_info info = mesh_of(self, in.small(0));
  std::vector<float> found(info.has_uv != 0 ? 2 * size_t(info.vertex_count) : 0);
  if (!found.empty()) check(ts_mesh_get_uv(self.scene, in.small(0), found.data(), found.size()));
  for (size_t i = 1; i < found.size(); i += 2) found[i] = 1.0f - found[i];  // Godot's v points down
  return of_pairs(found);
}

// ---- time ----

Variant set_fixed_step(Self self, In in) {
  const ts_fixed_step step{sizeof(ts_fixed_step), in.small(1), in.small(2), in.real(0)};
  check(ts_world_set_fixed_step(self.world, &step));
  return of(true);
}

Variant advance(Self self, In in) {
  ts_clock clock{};
  clock.struct_size = sizeof clock;
  check(ts_world_advance(self.world, in.real(0), &clock));
  return of(int64_t(clock.steps_made));
}

Variant step(Self self, In in) {
  check(ts_world_step(self.world, in.real(0), in.small(1)));
  return of(true);
}

Variant hash(Self self, In) {
  uint64_t found = 0;
  check(ts_world_hash(self.world, &found));
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(found));
  return of(std::string(text));
}

Variant snapshot(Self self, In) {
  size_t size = 0;
  check(ts_world_snapshot(self.world, nullptr, 0, &size));
  std::vector<uint8_t> bytes(size);
  check(ts_world_snapshot(self.world, bytes.data(), bytes.size(), &size));
  return of_bytes(bytes);
}

Variant restore(Self self, In in) {
  const std::vector<uint8_t> bytes = in.bytes(0);
  check(ts_world_restore(self.world, bytes.data(), bytes.size()));
  return of(true);
}

Variant wake(Self self, In) {
  check(ts_world_wake(self.world));
  return of(true);
}

// ---- bodies ----

Variant spawn(Self self, In in) {
  const ts_pose pose = in.pose(1);
  ts_placement place{};
  place.struct_size = sizeof place;
  std::memcpy(place.position, pose.position, sizeof place.position);
  std::memcpy(place.rotation, pose.rotation, sizeof place.rotation);
  in.vector(2, place.velocity);
  in.vector(3, place.spin);
  ts_body body = 0;
  check(ts_world_spawn(self.world, in.small(0), &place, &body));
  return of(int64_t(body));
}

Variant despawn(Self self, In in) {
  check(ts_world_despawn(self.world, body_of(in)));
  return of(true);
}

Variant body(Self self, In in) {
  ts_body found = 0;
  check(ts_world_get_body(self.world, in.small(0), &found));
  return of(int64_t(found));
}

Variant asset_of(Self self, In in) {
  int32_t asset = 0;
  check(ts_body_get_asset(self.world, body_of(in), &asset));
  return of(int64_t(asset));
}

Variant status(Self self, In in) {
  int32_t found = 0;
  check(ts_body_get_status(self.world, body_of(in), &found));
  return of(int64_t(found));
}

Variant center(Self self, In in) {
  double found[3];
  check(ts_body_center(self.world, body_of(in), found));
  return of_vector(found);
}

Variant set_velocity(Self self, In in) {
  double linear[3], spin[3];
  in.vector(1, linear);
  in.vector(2, spin);
  check(ts_body_set_velocity(self.world, body_of(in), linear, spin));
  return of(true);
}

Variant apply_impulse(Self self, In in) {
  double impulse[3];
  in.vector(1, impulse);
  check(ts_body_apply_impulse(self.world, body_of(in), impulse, nullptr, 0));
  return of(true);
}

Variant mesh(Self self, In in) {
  const size_t count = 3 * size_t(mesh_of(self, in.small(1)).vertex_count);
  self.positions.resize(count);
  self.normals.resize(count);
  check(ts_body_mesh(self.world, body_of(in), in.small(1), self.positions.data(), self.normals.data(), count));
  return of_list({of_triples(self.positions), of_triples(self.normals)});
}

Variant positions(Self self, In in) {
  int32_t count = 0;
  check(ts_body_get_vertex_count(self.world, body_of(in), &count));
  self.positions.resize(3 * size_t(count));
  check(ts_body_positions(self.world, body_of(in), 1.0, self.positions.data(), self.positions.size()));
  return of_triples(self.positions);
}

// ---- levels of detail ----

Variant set_level(Self self, In in) {
  check(ts_body_set_level(self.world, body_of(in), in.small(1), in.small(2)));
  return of(true);
}

Variant get_level(Self self, In in) {
  int32_t level = 0;
  check(ts_body_get_level(self.world, body_of(in), &level));
  return of(int64_t(level));
}

// Returns the number of levels of detail of an asset.
Variant level_count(Self self, In in) {
  int32_t found = 0;
  check(ts_asset_get_level_count(self.scene, in.small(0), &found));
  return of(int64_t(found));
}

Variant vertex_count(Self self, In in) {
  int32_t found = 0;
  check(ts_body_get_vertex_count(self.world, body_of(in), &found));
  return of(int64_t(found));
}

// ---- events ----

Variant record_events(Self self, In in) {
  check(ts_world_record_events(self.world, in.small(0)));
  return of(true);
}

// Returns all waiting events. Each event has eight consecutive values: kind, body, other body, collider, impulse,
// duration, step, time.
Variant drain_events(Self self, In) {
  constexpr size_t kAtOnce = 256;
  size_t count = 0, got = kAtOnce;
  while (got == kAtOnce) {
    self.events.resize(std::max(self.events.size(), count + kAtOnce));
    check(ts_world_drain_events(self.world, self.events.data() + count, sizeof(ts_event), kAtOnce, &got));
    count += got;
  }
  std::vector<Variant> found;
  found.reserve(8 * count);
  for (size_t i = 0; i < count; ++i) {
    const ts_event& each = self.events[i];
    for (const int64_t number : {int64_t(each.kind), int64_t(each.body), int64_t(each.other), int64_t(each.collider)}) {
      found.push_back(of(number));
    }
    found.push_back(of_vector(each.impulse));
    found.push_back(of(each.duration));
    found.push_back(of(each.step));
    found.push_back(of(each.time));
  }
  return of_list(found);
}

Variant dropped_events(Self self, In) {
  int64_t found = 0;
  check(ts_world_dropped_events(self.world, &found));
  return of(found);
}

// ---- queries ----

// Returns body, triangle, distance, point, normal, weights and vertices of the triangle; or an empty Array.
Variant raycast(Self self, In in) {
  double origin[3], direction[3];
  in.vector(0, origin);
  in.vector(1, direction);
  ts_hit hit{};
  hit.struct_size = sizeof hit;
  check(ts_world_raycast(self.world, origin, direction, in.real(2), &hit));
  if (hit.body == 0) return of_list({});
  return of_list({of(int64_t(hit.body)), of(int64_t(hit.triangle)), of(hit.distance), of_vector(hit.point),
                  of_vector(hit.normal), of_vector(hit.weights),
                  of_whole_numbers({hit.vertices[0], hit.vertices[1], hit.vertices[2]})});
}

Variant of_bodies(const std::vector<ts_body>& bodies, size_t count) {
  std::vector<Variant> found;
  for (size_t i = 0; i < count; ++i) found.push_back(of(int64_t(bodies[i])));
  return of_list(found);
}

Variant overlap_sphere(Self self, In in) {
  double center[3];
  in.vector(0, center);
  std::vector<ts_body> bodies(size_t(info_of(self).slot_count));
  size_t count = 0;
  check(ts_world_overlap_sphere(self.world, center, in.real(1), bodies.data(), bodies.size(), &count));
  return of_bodies(bodies, count);
}

Variant overlap_box(Self self, In in) {
  const ts_pose pose = in.pose(0);
  double size[3];
  in.vector(1, size);
  std::vector<ts_body> bodies(size_t(info_of(self).slot_count));
  size_t count = 0;
  check(ts_world_overlap_box(self.world, &pose, size, bodies.data(), bodies.size(), &count));
  return of_bodies(bodies, count);
}

// ---- grabs ----

ts_grab grab_in(In in) { return ts_grab(in.whole(0)); }

Variant grab(Self self, In in) {
  ts_pull pull{};
  pull.struct_size = sizeof pull;
  pull.triangle = in.small(1);
  in.vector(2, pull.weights);
  in.vector(3, pull.point);
  pull.frequency = in.real(4);
  pull.max_force = in.real(5);
  ts_grab made = 0;
  check(ts_body_grab(self.world, body_of(in), &pull, &made));
  return of(int64_t(made));
}

// Returns the grab with an index, 0 to 15; 0 if there is none.
Variant grab_of(Self self, In in) {
  ts_grab found = 0;
  check(ts_world_get_grab(self.world, in.small(0), &found));
  return of(int64_t(found));
}

Variant move_grab(Self self, In in) {
  double point[3];
  in.vector(1, point);
  check(ts_grab_move(self.world, grab_in(in), point));
  return of(true);
}

Variant release_grab(Self self, In in) {
  check(ts_grab_release(self.world, grab_in(in)));
  return of(true);
}

Variant grab_force(Self self, In in) {
  double found[3];
  check(ts_grab_get_force(self.world, grab_in(in), found));
  return of_vector(found);
}

// ---- gravity and friction ----

Variant set_gravity(Self self, In in) {
  double gravity[3];
  in.vector(0, gravity);
  check(ts_world_set_gravity(self.world, gravity));
  return of(true);
}

Variant set_friction(Self self, In in) {
  check(ts_world_set_friction(self.world, in.real(0)));
  return of(true);
}

Variant set_body_friction(Self self, In in) {
  check(ts_body_set_friction(self.world, body_of(in), in.real(1)));
  return of(true);
}

Variant set_collider_friction(Self self, In in) {
  check(ts_collider_set_friction(self.world, in.small(0), in.real(1)));
  return of(true);
}

// ---- joints and motors ----

Variant join(Self self, In in) {
  const std::vector<int32_t> vertices = in.whole_numbers(1), onto = in.whole_numbers(3);
  if (!onto.empty() && onto.size() != vertices.size()) throw Refused("argument 4 must have one vertex per vertex of argument 2");
  ts_joint made = 0;
  check(ts_body_join(self.world, body_of(in), vertices.data(), vertices.size(), ts_body(in.whole(2)),
                     onto.empty() ? nullptr : onto.data(), &made));
  return of(int64_t(made));
}

// Returns the joint with an index, 0 to 63; 0 if there is none.
Variant joint_of(Self self, In in) {
  ts_joint found = 0;
  check(ts_world_get_joint(self.world, in.small(0), &found));
  return of(int64_t(found));
}

Variant release_joint(Self self, In in) {
  check(ts_joint_release(self.world, ts_joint(in.whole(0))));
  return of(true);
}

Variant joint_force(Self self, In in) {
  double found[3];
  check(ts_joint_get_force(self.world, ts_joint(in.whole(0)), found));
  return of_vector(found);
}

Variant add_motor(Self self, In in) {
  const std::vector<int32_t> vertices = in.whole_numbers(1);
  ts_drive drive{};
  drive.struct_size = sizeof drive;
  drive.turns = in.small(2), drive.is_fixed = in.small(3), drive.has_point = in.small(4);
  in.vector(5, drive.axis);
  in.vector(6, drive.point);
  drive.speed = in.real(7), drive.limit = in.real(8);
  ts_motor made = 0;
  check(ts_body_add_motor(self.world, body_of(in), vertices.data(), vertices.size(), &drive, &made));
  return of(int64_t(made));
}

Variant motor_of(Self self, In in) {
  ts_motor found = 0;
  check(ts_world_get_motor(self.world, in.small(0), &found));
  return of(int64_t(found));
}

Variant set_motor_speed(Self self, In in) {
  check(ts_motor_set_speed(self.world, ts_motor(in.whole(0)), in.real(1)));
  return of(true);
}

Variant set_motor_limit(Self self, In in) {
  check(ts_motor_set_limit(self.world, ts_motor(in.whole(0)), in.real(1)));
  return of(true);
}

// Returns the speed of a motor, and its torque or force.
Variant motor_state(Self self, In in) {
  double speed = 0.0, effort = 0.0;
  check(ts_motor_get_speed(self.world, ts_motor(in.whole(0)), &speed));
  check(ts_motor_get_effort(self.world, ts_motor(in.whole(0)), &effort));
  return of_list({of(speed), of(effort)});
}

Variant remove_motor(Self self, In in) {
  check(ts_motor_remove(self.world, ts_motor(in.whole(0))));
  return of(true);
}

// ---- colliders and frames ----

Variant add_collider(Self self, In in) {
  ts_shape shape{};
  shape.struct_size = sizeof shape;
  shape.kind = in.small(0);
  in.vector(1, shape.size);
  const ts_pose pose = in.pose(2);
  shape.friction = in.real(3);
  shape.restitution = in.real(4);
  shape.thickness = in.real(5);
  shape.group = in.small(6);
  shape.mask = in.small(7);
  int32_t number = 0;
  check(ts_collider_add(self.world, &shape, &pose, &number));
  return of(int64_t(number));
}

Variant remove_collider(Self self, In in) {
  check(ts_collider_remove(self.world, in.small(0)));
  return of(true);
}

Variant move_collider(Self self, In in) {
  const ts_pose pose = in.pose(1);
  check(ts_collider_move_to(self.world, in.small(0), &pose));
  return of(true);
}

Variant teleport_collider(Self self, In in) {
  const ts_pose pose = in.pose(1);
  check(ts_collider_teleport(self.world, in.small(0), &pose));
  return of(true);
}

Variant collider_impulse(Self self, In in) {
  double impulse[3], moment[3];
  check(ts_collider_get_impulse(self.world, in.small(0), impulse, moment));
  return of_list({of_vector(impulse), of_vector(moment)});
}

Variant collider_position(Self self, In in) {
  ts_pose pose;
  check(ts_collider_get_pose(self.world, in.small(0), &pose));
  return of_vector(pose.position);
}

Variant move_frame(Self self, In in) {
  const ts_pose pose = in.pose(1);
  check(ts_frame_move_to(self.world, in.small(0), &pose));
  return of(true);
}

Variant add_frame(Self self, In in) {
  const ts_pose pose = in.pose(0);
  int32_t number = 0;
  check(ts_frame_add(self.world, &pose, &number));
  return of(int64_t(number));
}

Variant remove_frame(Self self, In in) {
  check(ts_frame_remove(self.world, in.small(0)));
  return of(true);
}

Variant frame_pose(Self self, In in) {
  ts_pose pose;
  check(ts_frame_get_pose(self.world, in.small(0), &pose));
  const double *q = pose.rotation, x = q[0], y = q[1], z = q[2], w = q[3];
  const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                             {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                             {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  float numbers[12];
  std::copy(&rows[0][0], &rows[0][0] + 9, numbers);
  std::copy(pose.position, pose.position + 3, numbers + 9);
  return of_transform(numbers);
}

Variant attach(Self self, In in) {
  const std::vector<int32_t> vertices = in.whole_numbers(1);
  check(ts_body_attach(self.world, body_of(in), vertices.data(), vertices.size(), in.small(2), in.small(3)));
  return of(true);
}

Variant detach(Self self, In in) {
  const std::vector<int32_t> vertices = in.whole_numbers(1);
  check(ts_body_detach(self.world, body_of(in), vertices.data(), vertices.size()));
  return of(true);
}

// Returns force and torque of a body on a frame. The name is not `load`, because that method reads the world file.
Variant frame_load(Self self, In in) {
  double force[3], torque[3];
  check(ts_body_get_load(self.world, body_of(in), in.small(1), force, torque));
  return of_list({of_vector(force), of_vector(torque)});
}

Variant last_error(Self self, In) { return of(self.last_error); }

}  // namespace

const std::vector<Method> methods = {
    {"load", 1, load},
    {"unload", 0, unload},
    {"count", 1, count},
    {"find", 2, find},
    {"name_of", 2, name_of},
    {"mesh_info", 1, mesh_info},
    {"triangles", 1, triangles},
    {"uvs", 1, uvs},
    {"set_fixed_step", 3, set_fixed_step},
    {"advance", 1, advance},
    {"step", 2, step},
    {"state_hash", 0, hash},
    {"snapshot", 0, snapshot},
    {"restore", 1, restore},
    {"wake", 0, wake},
    {"spawn", 4, spawn},
    {"despawn", 1, despawn},
    {"body", 1, body},
    {"asset_of", 1, asset_of},
    {"status", 1, status},
    {"center", 1, center},
    {"set_velocity", 3, set_velocity},
    {"apply_impulse", 2, apply_impulse},
    {"mesh", 2, mesh},
    {"positions", 1, positions},
    {"set_level", 3, set_level},
    {"get_level", 1, get_level},
    {"level_count", 1, level_count},
    {"vertex_count", 1, vertex_count},
    {"record_events", 1, record_events},
    {"drain_events", 0, drain_events},
    {"dropped_events", 0, dropped_events},
    {"raycast", 3, raycast},
    {"overlap_sphere", 2, overlap_sphere},
    {"overlap_box", 2, overlap_box},
    {"grab", 6, grab},
    {"grab_of", 1, grab_of},
    {"move_grab", 2, move_grab},
    {"release_grab", 1, release_grab},
    {"grab_force", 1, grab_force},
    {"set_gravity", 1, set_gravity},
    {"set_friction", 1, set_friction},
    {"set_body_friction", 2, set_body_friction},
    {"set_collider_friction", 2, set_collider_friction},
    {"join", 4, join},
    {"joint_of", 1, joint_of},
    {"release_joint", 1, release_joint},
    {"joint_force", 1, joint_force},
    {"add_motor", 9, add_motor},
    {"motor_of", 1, motor_of},
    {"set_motor_speed", 2, set_motor_speed},
    {"set_motor_limit", 2, set_motor_limit},
    {"motor_state", 1, motor_state},
    {"remove_motor", 1, remove_motor},
    {"add_collider", 8, add_collider},
    {"remove_collider", 1, remove_collider},
    {"move_collider", 2, move_collider},
    {"teleport_collider", 2, teleport_collider},
    {"collider_impulse", 1, collider_impulse},
    {"collider_position", 1, collider_position},
    {"add_frame", 1, add_frame},
    {"remove_frame", 1, remove_frame},
    {"move_frame", 2, move_frame},
    {"frame_pose", 1, frame_pose},
    {"attach", 4, attach},
    {"detach", 2, detach},
    {"frame_load", 2, frame_load},
    {"last_error", 0, last_error},
};

Variant call(WorldNative& self, const Method& method, int count, const Variant* const* values) {
  try {
    if (count != method.argument_count) {
      throw Refused("takes " + std::to_string(method.argument_count) + " arguments, got " + std::to_string(count));
    }
    return method.call(self, Arguments(values));
  } catch (const std::exception& error) {
    self.last_error = error.what();
    show_error(error.what(), method.name);
  }
  return nothing();
}

}  // namespace taichi_soft_godot
