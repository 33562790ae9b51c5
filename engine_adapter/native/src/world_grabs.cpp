// Grabs, with the same results as taichi_soft/control/grabs.py.

#include <algorithm>
#include <cmath>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

constexpr ts_grab kGrab = uint64_t(4) << 56;  // prefix of grab handles
constexpr double kTwoPi = 6.283185307179586;

}  // namespace

ts_grab World::grab_at(int32_t number) const {
  if (number < 0 || size_t(number) >= kMostGrabs) {
    fail(TS_ERROR_ARGUMENT, "number is %d: give 0 to %zu", number, kMostGrabs - 1);
  }
  if (fields_.grabs.body(size_t(number)) == 0) return 0;
  return kGrab | ts_grab(grab_generations_[size_t(number)]) << 32 | uint32_t(number + 1);
}

size_t World::grab_of(ts_grab grab) const {
  const int64_t number = int64_t(grab & 0xFFFFFFFFu) - 1;
  if (number < 0 || number >= int64_t(kMostGrabs) || grab_at(int32_t(number)) != grab) {
    fail(TS_ERROR_HANDLE, "grab %llu is not in this world, or was released", static_cast<unsigned long long>(grab));
  }
  return size_t(number);
}

ts_grab World::grab(int32_t slot, int32_t triangle, const double given[3], const Vector& point, double frequency,
                    double max_force) {
  const Asset& asset = asset_of(slot);
  if (asset.surface.count == 0) fail(TS_ERROR_STATE, "the body in slot %d has no surface to grab", slot);
  if (triangle < 0 || size_t(triangle) >= asset.surface.count / 3) {
    fail(TS_ERROR_ARGUMENT, "triangle %d does not exist (%zu in all, numbered from 0)", triangle,
         asset.surface.count / 3);
  }
  double sum = 0.0, weights[3];
  for (int i = 0; i < 3; ++i) sum = sum + given[i];
  if (!(std::min({given[0], given[1], given[2]}) >= -1e-3) || !(std::fabs(sum - 1.0) <= 1e-3)) {
    fail(TS_ERROR_ARGUMENT, "weights must be 0 or more and have the sum 1, got %g, %g and %g", given[0], given[1],
         given[2]);
  }
  if (!(frequency >= 1e-3 && frequency <= 1e3)) {
    fail(TS_ERROR_ARGUMENT, "frequency is %g Hz: give 0.001 to 1000", frequency);
  }
  if (!(max_force <= 1e20)) fail(TS_ERROR_ARGUMENT, "max_force is %g N: give at most 1e20", max_force);
  size_t g = 0;
  while (g < kMostGrabs && fields_.grabs.body(g) != 0) ++g;
  if (g == kMostGrabs) fail(TS_ERROR_STATE, "all %zu grabs of this world are in use: release one first", kMostGrabs);

  for (int i = 0; i < 3; ++i) weights[i] = std::max(given[i], 0.0);
  sum = weights[0] + weights[1] + weights[2];
  for (double& each : weights) each = each / sum;
  const double omega = kTwoPi * frequency;
  double mass = 0.0;
  for (double each : asset.masses) mass += each;
  const double strongest = max_force < 0.0 ? scene_->pull_in_weights * mass : max_force;
  const int32_t* corners = asset.surface.data + 3 * triangle;
  // A rigid body is held at its four vertices, which carry the point.
  int32_t holders[kGrabCorners] = {corners[0], corners[1], corners[2], corners[0]};
  double shares[kGrabCorners] = {weights[0], weights[1], weights[2], 0.0};
  if (asset.is_rigid()) {
    for (size_t k = 0; k < 4; ++k) {
      holders[k] = asset.tets[k], shares[k] = 0.0;
      for (size_t i = 0; i < 3; ++i)
        shares[k] = shares[k] + weights[i] * asset.hull_weights[4 * size_t(corners[i]) + k];
    }
  }
  const Patch patch = asset.is_rigid() ? Patch{{holders, holders + 4}, {shares, shares + 4}, kStrongest}
                                       : patch_around(asset, corners, weights, 3);

  fields_.grabs.body(g) = slot + 1;
  for (size_t i = 0; i < kGrabCorners; ++i) {
    fields_.grabs.corners(g, i) = int32_t(particle(slot, size_t(holders[i])));
    fields_.grabs.weights(g, i) = as_float(shares[i]);
  }
  const double spring[3] = {mass * (omega * omega), 2 * mass * omega, 2 * scene_->highest_pull_speed / omega};
  const double limits[3] = {std::min(strongest, patch.strength), strongest, 1 / mass};
  for (int k = 0; k < 3; ++k) {
    fields_.grabs.spring(g, k) = as_float(spring[k]);
    fields_.grabs.limits(g, k) = as_float(limits[k]);
    fields_.grabs.force(g, k) = 0.0f;
  }
  give_target(g, point);
  write_patch(g, slot, patch);
  fields_.body_drives(slot) |= kGrabbed;
  grab_generations_[g] = (grab_generations_[g] + 1) & 0xFFFFFF;
  mark_modified(slot);
  return grab_at(int32_t(g));
}

// Patch around a point of the rest shape. The point is given by weights of `count` corners, three or four.
Patch World::patch_around(const Asset& asset, const int32_t* corners, const double* weights, uint32_t count) {
  const uint32_t n = uint32_t(asset.vertex_count()), elements = uint32_t(asset.element_stiffness.count);
  const double* rows = machine_->rows.room<double>(2 * n);
  const double* strength = machine_->found.room<double>(1);
  machine_->launch("shape_patch", {Machine::array(corners, count), Machine::array(weights, count),
                                   Machine::array(scene_->patch_limits.data, uint32_t(scene_->patch_limits.count)),
                                   Machine::array(asset.vertices.data, n, 3), Machine::array(asset.masses.data, n),
                                   Machine::array(asset.elements.data, elements, uint32_t(asset.element_width)),
                                   Machine::array(asset.element_stiffness.data, elements),
                                   Machine::array(machine_->rows, n, 2), Machine::array(machine_->found, 1)});
  Patch found{{}, {}, *strength};
  for (uint32_t v = 0; v < n; ++v) {
    if (rows[2 * v] == 0.0) continue;
    found.vertices.push_back(int32_t(v));
    found.shares.push_back(rows[2 * v + 1]);
  }
  return found;
}

void World::write_patch(size_t g, int32_t slot, const Patch& patch) {
  fields_.grabs.count(g) = int32_t(patch.vertices.size());
  for (size_t i = 0; i < patch.vertices.size(); ++i) {
    fields_.grabs.particle(g * kPatchRows + i) = int32_t(particle(slot, size_t(patch.vertices[i])));
    fields_.grabs.share(g * kPatchRows + i) = as_float(patch.shares[i]);
  }
}

void World::give_target(size_t g, const Vector& point) {
  for (int k = 0; k < 3; ++k) {
    const float x = as_float(point[k]), residue = as_float(point[k] - double(x));
    fields_.grabs.target(g, k) = x;
    fields_.grabs.residue(g, k) = residue_of(x, residue);
  }
}

void World::move_grab(ts_grab grab, const Vector& point) {
  const size_t g = grab_of(grab);
  give_target(g, point);
  mark_modified(fields_.grabs.body(g) - 1);
}

void World::release(ts_grab grab) { end_grab(grab_of(grab)); }

void World::end_grab(size_t g) {
  const int32_t body = fields_.grabs.body(g);
  fields_.grabs.body(g) = 0;
  bool is_held = false;
  for (size_t each = 0; each < kMostGrabs; ++each) is_held = is_held || fields_.grabs.body(each) == body;
  if (!is_held) fields_.body_drives(body - 1) &= ~kGrabbed;
  mark_modified(body - 1);
}

Vector World::grab_force(ts_grab grab) const {
  const size_t g = grab_of(grab);
  return {fields_.grabs.force(g, 0), fields_.grabs.force(g, 1), fields_.grabs.force(g, 2)};
}

}  // namespace taichi_soft
