#include <algorithm>
#include <limits>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

// Writes the slots of all bodies into a buffer. Returns: number of bodies.
uint32_t World::write_active_slots() {
  int32_t* slots = machine_->rows.room<int32_t>(size_t(scene_->slot_count));
  uint32_t count = 0;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    if (fields_.body_status(slot) != kAbsent) slots[count++] = slot;
  }
  return count;
}

Hit World::hit_from(const float* row) const {
  Hit found;
  if (row[10] < 0.0f) return found;
  found.slot = int32_t(row[10]);
  found.triangle = int32_t(row[11]);
  found.distance = row[0];
  const Archive::View<int32_t>& surface = asset_of(found.slot).surface;
  for (int k = 0; k < 3; ++k) {
    // In a body without triangles, single vertices are hit.
    found.vertices[k] = surface.count == 0 ? found.triangle : surface[size_t(3 * found.triangle + k)];
    found.weights[k] = row[1 + k];
    found.point[k] = row[4 + k];
    found.normal[k] = row[7 + k];
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
  double largest = 0.0;
  for (double each : direction) largest = std::max(largest, std::fabs(each));
  if (largest == 0.0) fail(TS_ERROR_ARGUMENT, "direction has zero length");
  const Vector scaled = {direction[0] / largest, direction[1] / largest, direction[2] / largest};
  const double length = length_of(scaled);
  const uint32_t count = write_active_slots();
  float* ray = machine_->numbers.room<float>(8);
  float* hit = machine_->found.room<float>(12);
  for (int k = 0; k < 3; ++k) ray[k] = as_float(origin[k]), ray[3 + k] = as_float(scaled[k] / length);
  ray[6] = next_above(farthest), ray[7] = 1.0f;
  std::fill(hit, hit + 12, -1.0f);
  if (count > 0) {
    machine_->launch("find_hits", {Machine::array(machine_->rows, count), Machine::array(machine_->numbers, 1, 8),
                                   Machine::array(machine_->found, 1, 12)});
  }
  return hit_from(hit);
}

Hit World::closest(const Vector& point, double farthest) {
  const uint32_t count = write_active_slots();
  float* asked = machine_->numbers.room<float>(4);
  float* hit = machine_->found.room<float>(13);
  for (int k = 0; k < 3; ++k) asked[k] = as_float(point[k]);
  asked[3] = next_above(farthest * farthest);
  std::fill(hit, hit + 13, -1.0f);
  if (count > 0) {
    machine_->launch("find_closest", {Machine::array(machine_->rows, count), Machine::array(machine_->numbers, 4),
                                      Machine::array(machine_->found, 1, 13)});
  }
  Hit nearest = hit_from(hit);
  nearest.is_inside = hit[12] != 0.0f;
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
