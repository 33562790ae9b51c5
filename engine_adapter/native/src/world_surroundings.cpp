// Gravity, which holds for all bodies: as taichi_soft/control/drives.py has it.

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

void World::set_gravity(const Vector& gravity) {
  for (double each : gravity) {
    if (!(std::fabs(each) < scene_->position_limit)) {
      fail(TS_ERROR_ARGUMENT, "gravity is %g m/s^2: stay below %g", each, scene_->position_limit);
    }
  }
  if (gravity == surroundings_.gravity) return;
  surroundings_.gravity = gravity;
  write_surroundings();
  rouse(-1);
}

void World::write_surroundings() {
  for (size_t k = 0; k < 3; ++k) gravity_(0, k) = as_float(surroundings_.gravity[k]);
}

bool World::is_in_order(const Surroundings& given) const {
  for (double each : given.gravity) {
    if (!(std::fabs(each) < scene_->position_limit)) return false;
  }
  return true;
}

}  // namespace taichi_soft
