// Reads contacts and the status of bodies from the fields, for events.

#include <algorithm>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

Present World::present() const {
  Present found;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) found.bodies.push_back(body_in(slot));
  for (const Collider& row : colliders_.rows) found.colliders.push_back(row.is_alive ? row.serial : 0);
  return found;
}

// Reads and clears the contacts of the last step, and reads the status of all bodies. Returns: impulses by pair.
std::map<Pair, std::array<float, 3>> World::look() {
  const uint32_t numbers = uint32_t(events_.status.size()), rows = uint32_t(events_.touch_rows);
  int32_t* status = machine_->numbers.room<int32_t>(numbers);
  const int32_t* who = machine_->rows.room<int32_t>(3 * rows);
  const float* impulses = machine_->found.room<float>(3 * rows);
  std::copy(events_.status.begin(), events_.status.end(), status);
  machine_->launch("read_touches", {Machine::whole(scene_->slot_count), Machine::array(machine_->numbers, numbers),
                                    Machine::array(machine_->rows, rows, 3), Machine::array(machine_->found, rows, 3)});
  std::copy(status, status + numbers, events_.status.begin());
  std::map<Pair, std::array<float, 3>> touches;
  for (int32_t i = 0; i < status[numbers - 1]; ++i) {
    touches[{who[3 * i], who[3 * i + 1], who[3 * i + 2]}] = {impulses[3 * i], impulses[3 * i + 1], impulses[3 * i + 2]};
  }
  return touches;
}

void World::record_events(int32_t kinds) {
  if ((kinds & ~TS_ALL_EVENTS) != 0) {
    fail(TS_ERROR_ARGUMENT, "kinds is %d: give bits of TS_CONTACT_BEGAN to TS_BROKE", kinds);
  }
  if (Events::looks_for(kinds)) look();
  if (scene_->has_soft_contact)
    fields_.soft.records_touches(0) = (kinds & (TS_CONTACT_BEGAN | TS_CONTACT_ENDED)) != 0 ? 1 : 0;
  events_.record(kinds, present());
}

void World::take_down(double dt, const std::vector<int32_t>& frozen) {
  if (events_.kinds() == 0) return;
  std::map<Pair, std::array<float, 3>> touches;
  if (events_.looks()) {
    touches = look();
    if (events_.status[events_.status.size() - 2] != 0) events_.lose(1);
  }
  std::vector<int32_t> sensors;
  if (events_.senses()) {
    for (size_t c = 0; c < colliders_.rows.size(); ++c) {
      if (colliders_.rows[c].is_alive && colliders_.rows[c].is_sensor) sensors.push_back(int32_t(c));
    }
  }
  events_.take_down(touches, inside_sensors(sensors), present(), frozen, steps_ - 1, time_, dt);
}

}  // namespace taichi_soft
