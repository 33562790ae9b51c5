#include "events.hpp"

#include <algorithm>

#include "error.hpp"

namespace taichi_soft {

namespace {

bool are_there(const Contact& contact, const Present& present) {
  const size_t other = size_t(contact.other);
  return present.bodies[size_t(contact.slot)] == contact.a &&
         (contact.kind == kOfBody ? present.bodies[other] == contact.b
                                  : other < present.colliders.size() && present.colliders[other] == contact.serial);
}

}  // namespace

Events::Events(const Archive& archive, size_t slots) : status(slots + 2, 0), sleepers_(slots, 0) {
  const auto limits = archive.get<double>("events/limits");
  if (limits.count != 3 || !(limits[1] >= 1.0 && limits[1] <= 1e9) || !(limits[2] >= 1.0 && limits[2] <= 1e9)) {
    fail(TS_ERROR_FILE, "the world file is invalid: events. Export it again");
  }
  pause_ = limits[0];
  most_ = size_t(limits[1]);
  touch_rows = size_t(limits[2]);
}

std::vector<ts_body> Events::sleeping(const Present& present) const {
  std::vector<ts_body> found = present.bodies;
  for (size_t slot = 0; slot < found.size(); ++slot) {
    if (status[slot] != kAsleep) found[slot] = 0;
  }
  return found;
}

void Events::record(int32_t kinds, const Present& present) {
  if ((kinds_ & kContacts) == 0) going_on_.clear();
  if ((kinds_ & kSensors) == 0) inside_.clear();
  if ((kinds_ & kSleep) == 0 || (kinds & kSleep) == 0) sleepers_ = sleeping(present);
  kinds_ = kinds;
}

void Events::tell(ts_event event) {
  if ((kinds_ & event.kind) != 0) waiting_.push_back(event);
}

void Events::follow(const std::map<Pair, std::array<float, 3>>& touches, const Present& present, int64_t step,
                    double time, double dt) {
  std::vector<ts_event> ended;
  for (auto each = going_on_.begin(); each != going_on_.end();) {
    Contact& contact = each->second;
    if (touches.count(each->first) == 0) {
      const bool is_moving = status[size_t(contact.slot)] == kActive ||
                             (contact.kind == kOfBody && status[size_t(contact.other)] == kActive);
      if (is_moving) {
        contact.pause += dt;
      } else {
        contact.touched = time;  // both objects are at rest, so they still touch
      }
    }
    if (contact.pause > pause_ - 1e-9 || !are_there(contact, present)) {
      ts_event event = {TS_CONTACT_ENDED,
                        contact.kind == kOfBody ? -1 : contact.other,
                        step,
                        time,
                        contact.a,
                        contact.b,
                        {},
                        contact.touched - contact.began};
      std::copy(contact.impulse, contact.impulse + 3, event.impulse);
      ended.push_back(event);
      each = going_on_.erase(each);
    } else {
      ++each;
    }
  }
  for (const auto& [pair, impulse] : touches) {
    if (going_on_.count(pair) == 0) {
      const auto [slot, kind, other] = pair;
      const bool is_body = kind == kOfBody;
      const ts_body a = present.bodies[size_t(slot)], b = is_body ? present.bodies[size_t(other)] : 0;
      const uint32_t serial = is_body ? 0 : present.colliders[size_t(other)];
      going_on_[pair] = {a, b, serial, slot, kind, other, time - dt, time, 0.0, {0.0, 0.0, 0.0}};
      tell({TS_CONTACT_BEGAN, is_body ? -1 : other, step, time, a, b, {impulse[0], impulse[1], impulse[2]}, 0.0});
    }
    Contact& contact = going_on_[pair];
    for (int k = 0; k < 3; ++k) contact.impulse[k] = contact.impulse[k] + impulse[k];
    contact.touched = time;
    contact.pause = 0.0;
  }
  for (const ts_event& event : ended) tell(event);
}

void Events::sense(const std::vector<std::pair<int32_t, int32_t>>& inside, const Present& present, int64_t step,
                   double time) {
  std::vector<Inside> now;
  for (const auto& [slot, sensor] : inside) {
    now.push_back({present.bodies[size_t(slot)], present.colliders[size_t(sensor)], slot, sensor});
  }
  const auto tell_those_only_in = [&](int32_t kind, const std::vector<Inside>& these, const std::vector<Inside>& others) {
    for (const Inside& each : these) {
      const bool is_in_both = std::any_of(others.begin(), others.end(), [&](const Inside& other) {
        return other.body == each.body && other.sensor == each.sensor && other.serial == each.serial;
      });
      if (!is_in_both) tell({kind, each.sensor, step, time, each.body, 0, {0.0, 0.0, 0.0}, 0.0});
    }
  };
  tell_those_only_in(TS_ENTERED, now, inside_);
  tell_those_only_in(TS_LEFT, inside_, now);
  inside_ = now;
}

void Events::take_down(const std::map<Pair, std::array<float, 3>>& touches,
                       const std::vector<std::pair<int32_t, int32_t>>& inside, const Present& present,
                       const std::vector<int32_t>& frozen, int64_t step, double time, double dt) {
  if ((kinds_ & kContacts) != 0) follow(touches, present, step, time, dt);
  const auto say = [&](int32_t kind, ts_body body) { tell({kind, -1, step, time, body, 0, {0.0, 0.0, 0.0}, 0.0}); };
  if (looks()) {  // also if sleep events are off, because a restore can turn them on
    const std::vector<ts_body> now = sleeping(present);
    for (size_t slot = 0; slot < now.size(); ++slot) {
      if (now[slot] != 0 && now[slot] != sleepers_[slot]) say(TS_FELL_ASLEEP, now[slot]);
    }
    for (size_t slot = 0; slot < now.size(); ++slot) {
      const ts_body before = sleepers_[slot];
      const bool is_on = status[slot] < kAbsent;  // a body that was switched off did not wake
      if (before != 0 && now[slot] != before && present.bodies[slot] == before && is_on) say(TS_WOKE, before);
    }
    sleepers_ = now;
  }
  for (int32_t slot : frozen) say(TS_FROZE, present.bodies[size_t(slot)]);
  if (senses()) sense(inside, present, step, time);
  while (waiting_.size() > most_) {
    waiting_.pop_front();
    ++dropped_;
  }
}

void Events::end_unless(const std::function<bool(const Contact&)>& may_touch) {
  for (auto& [pair, contact] : going_on_) {
    if (!may_touch(contact)) contact.pause = pause_;
  }
}

size_t Events::drain(ts_event* events, size_t capacity) {
  const size_t count = std::min(capacity, waiting_.size());
  std::copy(waiting_.begin(), waiting_.begin() + std::ptrdiff_t(count), events);
  waiting_.erase(waiting_.begin(), waiting_.begin() + std::ptrdiff_t(count));
  return count;
}

Events::Memory Events::memory() const {
  Memory found = {kinds_, status, sleepers_, {}, senses() ? inside_ : std::vector<Inside>()};
  if ((kinds_ & kContacts) != 0) {
    for (const auto& [pair, contact] : going_on_) found.contacts.push_back(contact);
  }
  return found;
}

void Events::recall(const Memory& memory, int64_t steps, const Present& present) {
  while (!waiting_.empty() && waiting_.back().step >= steps) waiting_.pop_back();
  going_on_.clear();
  if ((kinds_ & kContacts) != 0) {
    for (const Contact& each : memory.contacts) going_on_[{each.slot, each.kind, each.other}] = each;
  }
  inside_ = senses() ? memory.inside : std::vector<Inside>();
  if (looks_for(memory.kinds)) {
    status = memory.status;
    sleepers_ = memory.sleepers;
  } else if (looks()) {
    sleepers_ = sleeping(present);
  }
}

}  // namespace taichi_soft
