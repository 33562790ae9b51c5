// Motors, with the same results as taichi_soft/control/motors.py.

#include <algorithm>
#include <cmath>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

constexpr ts_motor kMotor = uint64_t(6) << 56;  // prefix of motor handles

}  // namespace

void require_motor_speed(double speed, double fastest) {
  if (!(std::fabs(speed) <= fastest)) fail(TS_ERROR_ARGUMENT, "speed is %g: give a number up to %g", speed, fastest);
}

void require_motor_limit(double limit) {
  if (!(limit >= 0.0 && limit <= kLargestLimit)) {
    fail(TS_ERROR_ARGUMENT, "limit is %g: give a number from 0 to %g", limit, kLargestLimit);
  }
}

// Direction of the current axis in the rest shape, computed from the current rotation of the vertices.
Vector World::axis_at_rest(int32_t slot, const std::vector<int32_t>& vertices, const Vector& axis) {
  const Asset& asset = asset_of(slot);
  std::vector<Vector> rest, now;
  std::vector<double> masses;
  for (int32_t v : vertices) {
    const double* at = asset.vertices.data + 3 * size_t(v);
    rest.push_back({at[0], at[1], at[2]});
    now.push_back(vertex_place(slot, v));
    masses.push_back(asset.masses[size_t(v)]);
  }
  const double mass = mass_of(slot, vertices);
  for (double& each : masses) each = each / mass;
  const uint32_t n = uint32_t(vertices.size());
  const double* found = machine_->found.room<double>(4);
  machine_->launch("find_rest_axis", {Machine::array(rest.data(), n, 3), Machine::array(now.data(), n, 3),
                                      Machine::array(masses.data(), n), Machine::array(axis.data(), 3),
                                      Machine::array(machine_->found, 4)});
  if (!(found[3] > kThinnest)) {
    fail(TS_ERROR_ARGUMENT, "the vertices are on a line, so no axis can rotate with them: give more, or set is_fixed");
  }
  return {found[0], found[1], found[2]};
}

std::vector<World::MotorRow> World::motors() const {
  std::vector<MotorRow> found;
  for (size_t m = 0; m < kMostMotors; ++m) {
    if (fields_.motors.motor.body(m) == 0) continue;
    MotorRow row;
    row.number = m;
    row.slot = fields_.motors.motor.body(m) - 1;
    row.turns = fields_.motors.motor.turns(m), row.is_fixed = fields_.motors.motor.is_fixed(m),
    row.has_point = fields_.motors.motor.has_point(m);
    for (size_t k = 0; k < 3; ++k)
      row.axis[k] = fields_.motors.motor.axis(m, k), row.point[k] = fields_.motors.motor.point(m, k);
    row.speed = fields_.motors.motor.speed(m), row.limit = fields_.motors.motor.limit(m);
    for (int32_t r = fields_.motors.motor.first(m); r < fields_.motors.motor.end(m); ++r) {
      row.particles.push_back(fields_.motors.particle(size_t(r)));
    }
    found.push_back(std::move(row));
  }
  return found;
}

// Replaces all motors by `rows`, which are in the order of their indices.
void World::write_motors(const std::vector<MotorRow>& rows) {
  for (size_t m = 0; m < kMostMotors; ++m) fields_.motors.motor.body(m) = 0;
  size_t at = 0;
  for (const MotorRow& row : rows) {
    const size_t m = row.number;
    fields_.motors.motor.body(m) = row.slot + 1;
    fields_.motors.motor.first(m) = int32_t(at);
    for (int32_t each : row.particles) fields_.motors.particle(at++) = each;
    fields_.motors.motor.end(m) = int32_t(at);
    fields_.motors.motor.turns(m) = row.turns, fields_.motors.motor.is_fixed(m) = row.is_fixed,
    fields_.motors.motor.has_point(m) = row.has_point;
    for (size_t k = 0; k < 3; ++k)
      fields_.motors.motor.axis(m, k) = row.axis[k], fields_.motors.motor.point(m, k) = row.point[k];
    fields_.motors.motor.speed(m) = row.speed, fields_.motors.motor.limit(m) = row.limit;
  }
  mark_driven();
}

void World::mark_driven() {
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) fields_.motors.is_driven(size_t(slot)) = 0;
  for (size_t m = 0; m < kMostMotors; ++m) {
    if (fields_.motors.motor.body(m) != 0) fields_.motors.is_driven(size_t(fields_.motors.motor.body(m) - 1)) = 1;
  }
}

size_t World::motor_rows() const {
  int32_t used = 0;
  for (size_t m = 0; m < kMostMotors; ++m) {
    if (fields_.motors.motor.body(m) != 0) used = std::max(used, fields_.motors.motor.end(m));
  }
  return size_t(used);
}

ts_motor World::motor_at(int32_t number) const {
  if (number < 0 || size_t(number) >= kMostMotors) {
    fail(TS_ERROR_ARGUMENT, "number is %d: give 0 to %zu", number, kMostMotors - 1);
  }
  if (fields_.motors.motor.body(size_t(number)) == 0) return 0;
  return kMotor | ts_motor(motor_generations_[size_t(number)]) << 32 | uint32_t(number + 1);
}

size_t World::motor_of(ts_motor motor) const {
  const int64_t number = int64_t(motor & 0xFFFFFFFFu) - 1;
  if (number < 0 || number >= int64_t(kMostMotors) || motor_at(int32_t(number)) != motor) {
    fail(TS_ERROR_HANDLE, "motor %llu is not in this world, or was removed", static_cast<unsigned long long>(motor));
  }
  return size_t(number);
}

bool World::turns(ts_motor motor) const { return fields_.motors.motor.turns(motor_of(motor)) != 0; }

ts_motor World::add_motor(int32_t slot, Vertices which, const Drive& drive) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  require_motor_limit(drive.limit);
  require_motor_speed(drive.speed, scene_->velocity_limit);
  const double length = length_of(drive.axis);
  if (!(length > 0.0)) fail(TS_ERROR_ARGUMENT, "axis has zero length");
  if (drive.has_point && !(drive.turns && drive.is_fixed)) {
    fail(TS_ERROR_ARGUMENT, "point is only for a rotation about a fixed axis: set turns and is_fixed too");
  }
  Vector axis = {drive.axis[0] / length, drive.axis[1] / length, drive.axis[2] / length};
  if (!drive.is_fixed) axis = axis_at_rest(slot, vertices, axis);
  int32_t number = 0;
  while (size_t(number) < kMostMotors && motor_at(number) != 0) ++number;
  if (size_t(number) == kMostMotors) {
    fail(TS_ERROR_STATE, "all %zu motors of this world are in use: remove one first", kMostMotors);
  }
  const size_t m = size_t(number), used = motor_rows();
  if (used + vertices.size() > kMotorRows) {
    fail(TS_ERROR_STATE, "the motors of a world have at most %zu particles, and %zu are in use: remove a motor first",
         kMotorRows, used);
  }
  MotorRow row;
  row.number = m, row.slot = slot;
  row.turns = drive.turns, row.is_fixed = drive.is_fixed, row.has_point = drive.has_point;
  for (size_t k = 0; k < 3; ++k) row.axis[k] = as_float(axis[k]), row.point[k] = as_float(drive.point[k]);
  row.speed = as_float(drive.speed), row.limit = as_float(drive.limit);
  for (int32_t vertex : vertices) row.particles.push_back(int32_t(particle(slot, size_t(vertex))));
  std::vector<MotorRow> rows = motors();
  const auto at = std::find_if(rows.begin(), rows.end(), [&](const MotorRow& each) { return each.number > m; });
  rows.insert(at, std::move(row));
  write_motors(rows);
  fields_.motors.impulse(m) = 0.0f;
  motor_generations_[m] = (motor_generations_[m] + 1) & 0xFFFFFF;
  mark_modified(slot);
  return motor_at(number);
}

void World::set_motor_speed(ts_motor motor, double speed) {
  const size_t m = motor_of(motor);
  require_motor_speed(speed, scene_->velocity_limit);
  fields_.motors.motor.speed(m) = as_float(speed);
  mark_modified(fields_.motors.motor.body(m) - 1);
}

void World::set_motor_limit(ts_motor motor, double limit) {
  const size_t m = motor_of(motor);
  require_motor_limit(limit);
  fields_.motors.motor.limit(m) = as_float(limit);
  mark_modified(fields_.motors.motor.body(m) - 1);
}

void World::remove_motor(ts_motor motor) { end_motor(motor_of(motor)); }

void World::end_motor(size_t m) {
  const int32_t slot = fields_.motors.motor.body(m) - 1;
  std::vector<MotorRow> rows = motors();
  rows.erase(std::find_if(rows.begin(), rows.end(), [&](const MotorRow& each) { return each.number == m; }));
  write_motors(rows);
  mark_modified(slot);
}

double World::motor_speed(ts_motor motor) {
  const size_t m = motor_of(motor);
  if (fields_.body_status(size_t(fields_.motors.motor.body(m) - 1)) == kFrozen) return 0.0;
  return machine_->launch("read_speed", {Machine::whole(int32_t(m))});
}

double World::motor_effort(ts_motor motor) const {
  const size_t m = motor_of(motor);
  if (fields_.body_status(size_t(fields_.motors.motor.body(m) - 1)) == kFrozen) return 0.0;
  return fields_.motors.impulse(m) / std::max(last_dt_, 1e-30);
}

}  // namespace taichi_soft
