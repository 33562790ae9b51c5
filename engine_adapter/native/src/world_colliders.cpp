#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

Collider& World::collider(int32_t number) {
  if (number < 0 || size_t(number) >= colliders_.rows.size() || !colliders_.rows[size_t(number)].is_alive) {
    fail(TS_ERROR_ARGUMENT, "collider %d does not exist (%zu in all, numbered from 0)", number, colliders_.rows.size());
  }
  return colliders_.rows[size_t(number)];
}

int32_t World::add_collider(const Collider& row) {
  const int32_t number = colliders_.free_row();
  if (size_t(number) >= collider_room_) {
    fail(TS_ERROR_STATE, "there is room for %zu colliders and all are in use: export with a larger collider_room",
         collider_room_);
  }
  if (size_t(number) == colliders_.rows.size()) colliders_.rows.push_back(Collider{});
  const uint32_t serial = colliders_.rows[size_t(number)].serial + 1;
  colliders_.rows[size_t(number)] = row;
  colliders_.rows[size_t(number)].serial = serial;
  machine_->launch("forget_collider", {Machine::whole(scene_->slot_count), Machine::whole(number)});
  write_colliders();
  colliders_.is_dirty = true;
  wake_beside(row);
  return number;
}

void World::remove_collider(int32_t number) {
  Collider& row = collider(number);
  row.is_alive = false;
  write_colliders();
  colliders_.is_dirty = true;
  wake_beside(row);
}

void World::write_colliders() {
  fields_.colliders.count(0) = int32_t(colliders_.rows.size());
  for (size_t c = 0; c < colliders_.rows.size(); ++c) {
    const Collider& row = colliders_.rows[c];
    fields_.colliders.kind(c) = row.is_alive ? row.kind : -1;
    for (int k = 0; k < 8; ++k) fields_.colliders.parameters(c, k) = row.parameters[k];
    fields_.colliders.surface(c, 0) = as_float(row.friction);
    fields_.colliders.surface(c, 1) = as_float(row.restitution);
    fields_.colliders.surface(c, 2) = as_float(row.skin);
    for (size_t k = 0; k < 3; ++k) fields_.colliders.surface_velocity(c, k) = as_float(row.surface_velocity[k]);
    // No body has a bit of an empty group, so that no kernel of contact sees a sensor.
    fields_.colliders.filter(c, 0) = row.is_sensor ? 0 : row.group;
    fields_.colliders.filter(c, 1) = row.is_sensor ? 0 : row.mask;
  }
}

void World::wake_beside(const Collider& row) {
  double speed;
  if (!row.is_sensor) wake_near(row.way(0.0, &speed));
}

std::vector<std::pair<int32_t, int32_t>> World::inside_sensors(const std::vector<int32_t>& numbers) {
  std::vector<std::pair<int32_t, int32_t>> found;
  const uint32_t count = uint32_t(numbers.size()), slots = uint32_t(scene_->slot_count);
  if (count == 0) return found;
  int32_t* who = machine_->rows.room<int32_t>(3 * count);
  float* poses = machine_->numbers.room<float>(13 * count);
  const int32_t* inside = machine_->found.room<int32_t>(count * slots);
  for (int32_t number : numbers) {
    const Collider& row = colliders_.rows[size_t(number)];
    double speed;
    const Box box = row.way(0.0, &speed);
    *who++ = number, *who++ = row.group, *who++ = row.mask;
    for (int k = 0; k < 3; ++k) *poses++ = as_float(row.pose.position[k]);
    for (int k = 0; k < 4; ++k) *poses++ = as_float(row.pose.rotation[k]);
    for (int k = 0; k < 3; ++k) *poses++ = as_float(box.lower[k]);
    for (int k = 0; k < 3; ++k) *poses++ = as_float(box.upper[k]);
  }
  machine_->launch("find_bodies_inside",
                   {Machine::whole(scene_->slot_count), Machine::array(machine_->rows, count, 3),
                    Machine::array(machine_->numbers, count, 13), Machine::array(machine_->found, count, slots)});
  for (uint32_t slot = 0; slot < slots; ++slot) {
    for (uint32_t i = 0; i < count; ++i) {
      if (inside[i * slots + slot] != 0) found.push_back({int32_t(slot), numbers[i]});
    }
  }
  return found;
}

std::vector<int32_t> World::bodies_inside(int32_t number) {
  if (!collider(number).is_sensor) fail(TS_ERROR_ARGUMENT, "collider %d is no sensor: use ts_sensor_add", number);
  std::vector<int32_t> slots;
  for (const auto& [slot, sensor] : inside_sensors({number})) slots.push_back(slot);
  return slots;
}

void World::move_collider(int32_t number, const Pose& pose) {
  Collider& row = collider(number);
  row.target = pose;
  row.has_target = true;
  colliders_.is_dirty = colliders_.is_dirty || !row.is_sensor;
}

void World::set_collider_velocity(int32_t number, const Vector& linear, const Vector& spin) {
  Collider& row = collider(number);
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(linear[k]) < scene_->velocity_limit) || !(std::fabs(spin[k]) < scene_->spin_limit)) {
      fail(TS_ERROR_ARGUMENT, "a velocity of %g m/s or %g rad/s is too fast", linear[k], spin[k]);
    }
  }
  row.velocity = linear, row.spin = spin, row.has_target = false;
  colliders_.is_dirty = colliders_.is_dirty || !row.is_sensor;
}

void World::set_surface_velocity(int32_t number, const Vector& velocity) {
  Collider& row = collider(number);
  for (double each : velocity) {
    if (!(std::fabs(each) < scene_->velocity_limit)) {
      fail(TS_ERROR_ARGUMENT, "a surface velocity of %g m/s is too fast", each);
    }
  }
  if (velocity == row.surface_velocity) return;
  row.surface_velocity = velocity;
  write_colliders();
  wake_beside(row);
}

void World::teleport_collider(int32_t number, const Pose& pose) {
  Collider& row = collider(number);
  wake_beside(row);
  row.pose = pose;
  row.has_target = false;
  colliders_.is_dirty = colliders_.is_dirty || !row.is_sensor;
  wake_beside(row);
}

void World::collider_impulse(int32_t number, Vector* impulse, Vector* moment) {
  collider(number);
  const uint32_t count = uint32_t(colliders_.rows.size());
  const float* rows = machine_->rows.room<float>(6 * count);
  machine_->launch("sum_collider_impulses",
                   {Machine::whole(scene_->slot_count), Machine::array(machine_->rows, count, 6)});
  for (int k = 0; k < 3; ++k) (*impulse)[k] = rows[6 * number + k], (*moment)[k] = rows[6 * number + 3 + k];
}

}  // namespace taichi_soft
