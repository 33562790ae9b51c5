// Frames and attachments, with the same results as taichi_soft/control/frames.py and attachments.py.

#include <algorithm>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

void write_pose(const Pose& pose, float* row) {
  const Matrix turn = matrix_of(pose.rotation);
  for (int i = 0; i < 9; ++i) row[i] = as_float(turn[i / 3][i % 3]);
  for (int k = 0; k < 3; ++k) split(pose.position[k], row + 9 + k, row + 12 + k);
}

}  // namespace

size_t World::frame(int32_t number) const {
  if (number < 0 || size_t(number) >= frame_alive_.size() || frame_alive_[size_t(number)] == 0) {
    fail(TS_ERROR_ARGUMENT, "frame %d does not exist, or was removed", number);
  }
  return size_t(number);
}

int32_t World::add_frame(const Pose& pose) {
  size_t row = 0;
  while (row < frame_alive_.size() && frame_alive_[row] != 0) ++row;
  if (row >= kMostFrames) fail(TS_ERROR_STATE, "there are %zu frames: remove one first", row);
  if (row == frame_alive_.size()) {
    present_.resize(kFrameWidth * (row + 1));
    coming_.resize(kFrameWidth * (row + 1));
    frame_alive_.push_back(0);
  }
  frame_alive_[row] = 1;
  write_pose(pose, present_.data() + kFrameWidth * row);
  write_pose(pose, coming_.data() + kFrameWidth * row);
  return int32_t(row);
}

void World::remove_frame(int32_t number) {
  const size_t row = frame(number);
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    if (fields_.body_status(slot) != kAbsent) detach_vertices(slot, attached_vertices(slot, number));
  }
  frame_alive_[row] = 0;
}

void World::move_frame(int32_t number, const Pose& pose) {
  write_pose(pose, coming_.data() + kFrameWidth * frame(number));
}

Pose World::frame_pose(int32_t number) const {
  const float* row = present_.data() + kFrameWidth * frame(number);
  Matrix turn;
  for (int i = 0; i < 9; ++i) turn[i / 3][i % 3] = double(row[i]);
  return {{row[9], row[10], row[11]}, quaternion_of(turn)};
}

// Vertices that are attached to the frame `number`. A number of -1 means any frame.
std::vector<int32_t> World::attached_vertices(int32_t slot, int32_t number) const {
  std::vector<int32_t> found;
  for (size_t v = 0; v < asset_of(slot).vertex_count(); ++v) {
    const int32_t aim = fields_.particle_aim(particle(slot, v)) - kWithFrame;
    if (number < 0 ? aim >= 0 : aim == number) found.push_back(int32_t(v));
  }
  return found;
}

void World::attach(int32_t slot, Vertices which, int32_t number, bool feels) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  const float* row = present_.data() + kFrameWidth * frame(number);
  require_unattached(slot, vertices);
  const auto begin = attachments_.begin() + std::ptrdiff_t(begin_of(slot));
  const int32_t attachment = 1 + *std::max_element(begin, begin + std::ptrdiff_t(asset_of(slot).vertex_count()));
  for (int32_t vertex : vertices) {
    const size_t p = particle(slot, size_t(vertex));
    Vector offset = exact_position(slot, size_t(vertex));
    for (int k = 0; k < 3; ++k) offset[k] = offset[k] - (double(row[9 + k]) + double(row[12 + k]));
    for (int k = 0; k < 3; ++k) {
      fields_.particle_target(p, k) =
          as_float(double(row[k]) * offset[0] + double(row[3 + k]) * offset[1] + double(row[6 + k]) * offset[2]);
      fields_.particle_reaction(p, k) = 0.0f;
      if (scene_->has_rods) fields_.rod_reaction(p, k) = 0.0f;
    }
    fields_.particle_inv_mass(p) = 0.0f;
    fields_.particle_aim(p) = kWithFrame + number;
    feels_[p] = feels ? 1 : 0;
    attachments_[p] = attachment;
    break_forces_[p] = 0.0f;
    if (scene_->is_implicit) fields_.particle_contact(p) = 0;
  }
  fields_.body_drives(slot) |= kMovesPins | (feels ? kFeelsReaction : 0);
  mark_modified(slot);
  has_work_ = true;
}

void World::detach(int32_t slot, Vertices which) {
  std::vector<int32_t> vertices = checked(slot, which, true);
  const std::vector<int32_t> held = attached_vertices(slot, -1);
  if (which.count == 0) vertices = held;
  for (int32_t vertex : vertices) {
    if (!std::binary_search(held.begin(), held.end(), vertex)) {
      fail(TS_ERROR_STATE, "vertex %d of the body in slot %d is not attached to a frame", vertex, slot);
    }
  }
  detach_vertices(slot, vertices);
}

void World::detach_vertices(int32_t slot, const std::vector<int32_t>& vertices) {
  if (vertices.empty()) return;
  for (int32_t vertex : vertices) {
    const size_t p = particle(slot, size_t(vertex));
    fields_.particle_inv_mass(p) = 1.0f / fields_.particle_mass(p);
    fields_.particle_aim(p) = kStill;
    feels_[p] = 0;
    attachments_[p] = 0;
    break_forces_[p] = 0.0f;
  }
  if (!is_felt(slot, attached_vertices(slot, -1))) fields_.body_drives(slot) &= ~kFeelsReaction;
  mark_modified(slot);
}

bool World::is_felt(int32_t slot, const std::vector<int32_t>& vertices) const {
  return std::any_of(vertices.begin(), vertices.end(),
                     [&](int32_t vertex) { return feels_[particle(slot, size_t(vertex))] != 0; });
}

void World::set_break_force(int32_t slot, int32_t number, double force) {
  frame(number);
  if (!(force >= 0.0 && force <= kMostBreakForce)) {
    fail(TS_ERROR_ARGUMENT, "force is %g: give a force of 0 to %g N, 0 to never break", force, kMostBreakForce);
  }
  const std::vector<int32_t> vertices = attached_vertices(slot, number);
  if (!is_felt(slot, vertices)) {
    fail(TS_ERROR_STATE, "the load of the body in slot %d on frame %d is not recorded: attach it with feels = 1", slot,
         number);
  }
  for (int32_t vertex : vertices) {
    const size_t p = particle(slot, size_t(vertex));
    if (feels_[p] != 0) break_forces_[p] = as_float(force);
  }
}

// Releases the attachments whose mean force in the last step exceeds their limit.
void World::break_attachments(double dt) {
  if (std::all_of(break_forces_.begin(), break_forces_.end(), [](float each) { return each == 0.0f; })) return;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    if (fields_.body_status(slot) == kAbsent) continue;
    std::map<int32_t, std::vector<int32_t>> found;
    for (int32_t vertex : attached_vertices(slot, -1)) {
      const size_t p = particle(slot, size_t(vertex));
      if (break_forces_[p] > 0.0f) found[attachments_[p]].push_back(vertex);
    }
    for (const auto& each : found) {
      Vector impulse = {0.0, 0.0, 0.0};
      for (int32_t vertex : each.second) {
        const size_t p = particle(slot, size_t(vertex));
        for (int k = 0; k < 3; ++k) impulse[k] += fields_.particle_reaction(p, k);
      }
      const size_t first = particle(slot, size_t(each.second[0]));
      const double most = double(break_forces_[first]) * dt;
      const double x = impulse[0], y = impulse[1], z = impulse[2];
      if (!(x * x + y * y + z * z > most * most)) continue;
      const int32_t number = fields_.particle_aim(first) - kWithFrame;
      events_.tell({TS_BROKE, number, steps_ - 1, time_, body_in(slot), 0, {-x, -y, -z}, 0.0});
      detach_vertices(slot, each.second);
    }
  }
}

void World::load(int32_t slot, int32_t number, Vector* force, Vector* torque) const {
  const float* origin = present_.data() + kFrameWidth * frame(number) + 9;
  const std::vector<int32_t> vertices = attached_vertices(slot, number);
  if (vertices.empty()) fail(TS_ERROR_STATE, "the body in slot %d is not attached to frame %d", slot, number);
  if (!is_felt(slot, vertices)) {
    fail(TS_ERROR_STATE, "the load of the body in slot %d is not recorded: attach it with feels = 1", slot);
  }
  Vector impulse = {0.0, 0.0, 0.0}, moment = {0.0, 0.0, 0.0};
  for (int32_t vertex : vertices) {
    const size_t p = particle(slot, size_t(vertex));
    Vector part, arm;
    for (int k = 0; k < 3; ++k)
      part[k] = fields_.particle_reaction(p, k), arm[k] = fields_.particle_position(p, k) - origin[k];
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      impulse[k] += part[k];
      moment[k] += arm[i] * part[j] - arm[j] * part[i];
      if (scene_->has_rods) moment[k] += fields_.rod_reaction(p, k);
    }
  }
  const double dt = std::max(last_dt_, 1e-30);
  for (int k = 0; k < 3; ++k) (*force)[k] = impulse[k] / dt, (*torque)[k] = moment[k] / dt;
}

}  // namespace taichi_soft
