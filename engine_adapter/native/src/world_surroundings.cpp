// Gravity and friction, with the same results as taichi_soft/control/drives.py and frictions.py.

#include <algorithm>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

constexpr uint32_t kFirstSerial = 1;  // serial number of an exported collider

bool is_friction(double number) { return number >= 0.0 && number <= 1e6; }

void require_friction(double friction) {
  if (!is_friction(friction)) fail(TS_ERROR_ARGUMENT, "friction is %g: give a number from 0 to 1,000,000", friction);
}

}  // namespace

void World::set_gravity(const Vector& gravity) {
  for (double each : gravity) {
    if (!(std::fabs(each) < scene_->position_limit)) {
      fail(TS_ERROR_ARGUMENT, "gravity is %g m/s^2: stay below %g", each, scene_->position_limit);
    }
  }
  if (gravity == surroundings_.gravity) return;
  surroundings_.gravity = gravity;
  write_surroundings();
  mark_modified(-1);
}

// Subtracts `offset` from all places, with the same results as taichi_soft/solver/origin.py.
void World::shift_origin(const Vector& offset) {
  double* move = machine_->numbers.room<double>(3);
  const double* farthest = machine_->found.room<double>(1);
  std::copy(offset.begin(), offset.end(), move);
  const auto launch = [&](int32_t shifts) {
    machine_->launch("shift_places", {Machine::whole(shifts), Machine::array(machine_->numbers, 3),
                                      Machine::array(machine_->found, 1)});
  };
  launch(0);
  double largest = farthest[0];
  for (const Collider& row : colliders_.rows) {
    for (int k = 0; k < 3 && row.is_alive; ++k) {
      largest = std::max(largest, std::fabs(row.pose.position[k] - offset[k]));
    }
  }
  if (!(largest < scene_->position_limit)) {
    fail(TS_ERROR_ARGUMENT, "offset puts a body or collider %.4g m from the new origin: stay below %g m", largest,
         scene_->position_limit);
  }
  launch(1);
  for (Collider& row : colliders_.rows) {
    for (int k = 0; k < 3; ++k) {
      row.pose.position[k] = row.pose.position[k] - offset[k];
      row.target.position[k] = row.target.position[k] - offset[k];
    }
  }
  colliders_.is_dirty = true;
  for (std::vector<float>* poses : {&present_, &coming_}) {
    for (size_t row = 0; row < poses->size(); row += kFrameWidth) {
      for (size_t k = 0; k < 3; ++k) {
        float &x = (*poses)[row + 9 + k], &residue = (*poses)[row + 12 + k];
        split(double(x) + double(residue) - offset[k], &x, &residue);
      }
    }
  }
  if (scene_->has_floor) surroundings_.floor = surroundings_.floor - offset[2];
  if (has_view()) {
    set_view_origin({view_origin_[0] - offset[0], view_origin_[1] - offset[1], view_origin_[2] - offset[2]});
  }
  write_surroundings();
  is_still_ = false;
  rows_at_ = -1.0;
}

// Makes drawn positions relative to `point`, with the same results as `Readout.set_view_origin`.
void World::set_view_origin(const Vector& point) {
  view_origin_ = point;
  for (size_t k = 0; k < 3; ++k) {
    const float x = as_float(point[k]);
    fields_.view_origin(0, k) = x;
    fields_.view_origin(0, 3 + k) = as_float(point[k] - double(x));
  }
  rows_at_ = -1.0;
}

void World::set_friction(double friction) {
  require_friction(friction);
  const int32_t number = scene_->floor_collider;
  if (!scene_->has_floor || !is_floor(number)) {
    fail(TS_ERROR_STATE,
         "the world has no floor: use ts_collider_set_friction for a collider, or ts_body_set_friction for "
         "contact between bodies");
  }
  set_collider_friction(number, friction);
}

bool World::is_floor(int32_t number) const {
  if (number < 0 || number != scene_->floor_collider || size_t(number) >= colliders_.rows.size()) return false;
  const Collider& row = colliders_.rows[size_t(number)];
  return row.is_alive && row.serial == kFirstSerial;  // a later collider may occupy the row
}

void World::set_collider_friction(int32_t number, double friction) {
  Collider& row = collider(number);
  require_friction(friction);
  if (friction == row.friction) return;
  row.friction = friction;
  if (is_floor(number)) surroundings_.friction = friction;
  write_surroundings();
  write_colliders();
  wake_beside(row);
}

void World::set_body_friction(int32_t slot, double friction) {
  require_friction(friction);
  if (!scene_->has_soft_contact) {
    fail(TS_ERROR_STATE,
         "a body's friction applies between bodies, and this world has no soft contact: export it with "
         "soft_contact, or change the friction of the floor or a collider");
  }
  if (friction == friction_[size_t(slot)]) return;
  give_friction(slot, friction);
  mark_modified(slot);
}

void World::set_body_filter(int32_t slot, int32_t group, int32_t mask) {
  const size_t body = size_t(slot);
  if (fields_.body_filter(body, 0) == group && fields_.body_filter(body, 1) == mask) return;
  fields_.body_filter(body, 0) = group;
  fields_.body_filter(body, 1) = mask;
  mark_modified(slot);
  wake_near(box_of(slot));  // what lies on the body, or leans on it
  if (scene_->has_soft_contact) machine_->launch("mark_placed", {Machine::whole(slot)});
  end_forbidden_contacts();
}

void World::set_collider_filter(int32_t number, int32_t group, int32_t mask) {
  Collider& row = collider(number);
  if (row.group == group && row.mask == mask) return;
  row.group = group, row.mask = mask;
  write_colliders();
  wake_beside(row);
  end_forbidden_contacts();
}

// Makes the contacts of pairs that can no longer touch end in the next step.
void World::end_forbidden_contacts() {
  const auto may_touch = [&](const Contact& contact) {
    const size_t a = size_t(contact.slot), b = size_t(contact.other);
    const bool is_body = contact.kind == kOfBody;
    if (fields_.body_status(a) > kAbsent || (is_body && fields_.body_status(b) > kAbsent)) return false;
    const int32_t group = is_body ? fields_.body_filter(b, 0) : colliders_.rows[b].group;
    const int32_t mask = is_body ? fields_.body_filter(b, 1) : colliders_.rows[b].mask;
    return (fields_.body_filter(a, 0) & mask) != 0 && (group & fields_.body_filter(a, 1)) != 0;
  };
  events_.end_unless(may_touch);
}

void World::give_friction(int32_t slot, double friction) {
  friction_[size_t(slot)] = friction;
  if (scene_->has_soft_contact) fields_.body_surface(size_t(slot)) = as_float(friction);
}

void World::write_surroundings() {
  for (size_t k = 0; k < 3; ++k) fields_.gravity(0, k) = as_float(surroundings_.gravity[k]);
  fields_.floor(0, 0) = as_float(surroundings_.floor);
  fields_.floor(0, 2) = as_float(surroundings_.friction);
}

bool World::is_valid(const Surroundings& given) const {
  for (double each : given.gravity) {
    if (!(std::fabs(each) < scene_->position_limit)) return false;
  }
  return is_friction(given.friction) && std::fabs(given.floor) <= scene_->position_limit;
}

bool World::are_frictions(const double* numbers, size_t count) {
  return std::all_of(numbers, numbers + count, is_friction);
}

}  // namespace taichi_soft
