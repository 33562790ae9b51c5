#include <algorithm>
#include <limits>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

// Writes the slots of the bodies with a group in `mask` into a buffer. Returns: number of bodies.
uint32_t World::write_active_slots(int32_t mask) {
  int32_t* slots = machine_->rows.room<int32_t>(size_t(scene_->slot_count));
  uint32_t count = 0;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    const bool is_meant = mask == -1 || (fields_.body_filter(size_t(slot), 0) & mask) != 0;
    if (fields_.body_status(slot) != kAbsent && is_meant) slots[count++] = slot;
  }
  return count;
}

// Writes the numbers and poses of the colliders with a group in `mask` into buffers. Returns: number of colliders.
uint32_t World::write_chosen_colliders(int32_t mask) {
  const size_t room = colliders_.rows.size();
  int32_t* numbers = machine_->rows.room<int32_t>(room);
  float* poses = machine_->positions.room<float>(7 * room);
  uint32_t count = 0;
  for (size_t c = 0; c < room; ++c) {
    const Collider& row = colliders_.rows[c];
    if (!row.is_alive || row.is_sensor || (row.group & mask) == 0) continue;
    for (int k = 0; k < 3; ++k) poses[7 * count + k] = as_float(row.pose.position[k]);
    for (int k = 0; k < 4; ++k) poses[7 * count + 3 + k] = as_float(row.pose.rotation[k]);
    numbers[count++] = int32_t(c);
  }
  return count;
}

Hit World::hit_from(const float* row, int32_t collider) const {
  Hit found;
  if (row[10] < 0.0f && collider < 0) return found;
  found.slot = int32_t(row[10]);
  found.collider = collider;
  found.triangle = int32_t(row[11]);
  found.distance = row[0];
  for (int k = 0; k < 3; ++k) found.point[k] = row[4 + k], found.normal[k] = row[7 + k];
  if (collider >= 0) return found;
  const Archive::View<int32_t>& surface = asset_of(found.slot).surface;
  for (int k = 0; k < 3; ++k) {
    // In a body without triangles, single vertices are hit.
    found.vertices[k] = surface.count == 0 ? found.triangle : surface[size_t(3 * found.triangle + k)];
    found.weights[k] = row[1 + k];
  }
  if (surface.count == 0) found.triangle = -1;
  return found;
}

namespace {

// Next larger float. Kernels accept only distances below a limit, but a distance equal to `limit` must also count.
float next_above(double limit) {
  return std::nextafter(as_float(std::min(limit, 3e38)), std::numeric_limits<float>::infinity());
}

}  // namespace

Hit World::first_hit(const Vector& origin, const Vector& direction, double farthest) {
  return cast({TS_RAY, {}, {origin, {0.0, 0.0, 0.0, 1.0}}, direction, farthest, TS_BODIES, -1});
}

Hit World::cast(const Cast& cast) {
  enum { kOrigin = 0, kDirection = 3, kReach = 6, kCore = 7, kHalf = 8, kRadius = 11, kTurn = 12, kWidth = 16 };
  double largest = 0.0;
  for (double each : cast.direction) largest = std::max(largest, std::fabs(each));
  if (largest == 0.0) fail(TS_ERROR_ARGUMENT, "direction has zero length");
  const Vector scaled = {cast.direction[0] / largest, cast.direction[1] / largest, cast.direction[2] / largest};
  const double length = length_of(scaled);
  float* row = machine_->numbers.room<float>(kWidth);
  float* hit = machine_->found.room<float>(13);
  std::fill(row, row + kWidth, 0.0f);
  std::fill(hit, hit + 13, -1.0f);
  for (int k = 0; k < 3; ++k) {
    row[kOrigin + k] = as_float(cast.pose.position[k]), row[kDirection + k] = as_float(scaled[k] / length);
  }
  for (int k = 0; k < 4; ++k) row[kTurn + k] = as_float(cast.pose.rotation[k]);
  row[kReach] = next_above(cast.reach);
  if (cast.kind == TS_BOX) {
    row[kCore] = 2.0f;
    for (int k = 0; k < 3; ++k) row[kHalf + k] = cast.parameters[k];
  } else if (cast.kind == TS_CAPSULE) {
    row[kCore] = 1.0f;
    row[kHalf + 2] = cast.parameters[1];
  }
  if (cast.kind == TS_SPHERE || cast.kind == TS_CAPSULE) row[kRadius] = cast.parameters[0];
  const uint32_t bodies = (cast.targets & TS_BODIES) == 0 ? 0 : write_active_slots(cast.mask);
  if (bodies > 0 && cast.kind == TS_RAY) {
    row[kCore] = 1.0f;  // a ray's kernel ignores back faces if this number is not 0
    machine_->launch("find_hits", {Machine::array(machine_->rows, bodies), Machine::array(machine_->numbers, 1, 8),
                                   Machine::array(machine_->found, 1, 13)});
    row[kCore] = 0.0f;
  } else if (bodies > 0) {
    machine_->launch("cast_on_bodies",
                     {Machine::array(machine_->rows, bodies), Machine::array(machine_->numbers, 1, kWidth),
                      Machine::array(machine_->found, 1, 13)});
  }
  const uint32_t colliders = (cast.targets & TS_COLLIDERS) == 0 ? 0 : write_chosen_colliders(cast.mask);
  if (colliders > 0) {
    machine_->launch("cast_on_colliders",
                     {Machine::array(machine_->rows, colliders), Machine::array(machine_->positions, colliders, 7),
                      Machine::array(machine_->numbers, 1, kWidth), Machine::array(machine_->found, 1, 13)});
  }
  return hit_from(hit, int32_t(hit[12]));
}

Hit World::closest(const Vector& point, double farthest) { return nearest(point, farthest, TS_BODIES, -1); }

Hit World::nearest(const Vector& point, double farthest, int32_t targets, int32_t mask) {
  float* asked = machine_->numbers.room<float>(4);
  float* hit = machine_->found.room<float>(14);
  for (int k = 0; k < 3; ++k) asked[k] = as_float(point[k]);
  asked[3] = next_above(farthest * farthest);
  std::fill(hit, hit + 14, -1.0f);
  const uint32_t bodies = (targets & TS_BODIES) == 0 ? 0 : write_active_slots(mask);
  if (bodies > 0) {
    machine_->launch("find_closest", {Machine::array(machine_->rows, bodies), Machine::array(machine_->numbers, 4),
                                      Machine::array(machine_->found, 1, 14)});
  }
  const uint32_t colliders = (targets & TS_COLLIDERS) == 0 ? 0 : write_chosen_colliders(mask);
  if (colliders > 0) {
    machine_->launch("closest_on_colliders",
                     {Machine::array(machine_->rows, colliders), Machine::array(machine_->positions, colliders, 7),
                      Machine::array(machine_->numbers, 4), Machine::array(machine_->found, 1, 14)});
  }
  Hit nearest = hit_from(hit, int32_t(hit[13]));
  nearest.is_inside = hit[12] > 0.0f;
  return nearest;
}

std::vector<int32_t> World::overlaps(bool is_box, const Pose& pose, const Vector& size) {
  const uint32_t count = write_active_slots(), slots = uint32_t(scene_->slot_count);
  const uint32_t particles = uint32_t(scene_->particle_count);
  float* shape = machine_->numbers.room<float>(15);
  int32_t* first = machine_->found.room<int32_t>(slots);
  machine_->vertices.room<int32_t>(particles);  // output of the kernel that is not used here: vertices inside the shape
  const Matrix turn = matrix_of(pose.rotation);
  for (int k = 0; k < 3; ++k) {
    shape[k] = as_float(pose.position[k]);
    for (int j = 0; j < 3; ++j) shape[3 + 3 * j + k] = as_float(is_box ? turn[k][j] : j == k);
    shape[12 + k] = as_float(size[k]);
  }
  std::fill(first, first + slots, -1);
  if (count > 0) {
    machine_->launch("find_overlaps", {Machine::whole(is_box ? 1 : 0), Machine::array(machine_->rows, count),
                                       Machine::array(machine_->numbers, 5, 3), Machine::array(machine_->found, slots),
                                       Machine::array(machine_->vertices, particles)});
  }
  std::vector<int32_t> found;
  for (uint32_t slot = 0; slot < slots; ++slot) {
    if (first[slot] >= 0) found.push_back(int32_t(slot));
  }
  return found;
}

}  // namespace taichi_soft
