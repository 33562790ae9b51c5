// Events of steps, equal to the events of taichi_soft/events.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <vector>

#include "archive.hpp"
#include "constants.hpp"
#include "taichi_soft.h"

namespace taichi_soft {

using Pair = std::array<int32_t, 3>;  // slot of a body; kind of the other object; slot or number of the other object

struct Contact {    // current contact
  ts_body a, b;     // b is 0 if a touches a collider
  uint32_t serial;  // serial number of the collider
  int32_t slot, kind, other;
  double began, touched, pause;  // start of the first step, end of the last step, time since the last impulse [s]
  double impulse[3];
};

struct Inside {  // a body in a sensor
  ts_body body;
  uint32_t serial;  // serial number of the sensor
  int32_t slot, sensor;
};

// Bodies and colliders that exist after a step.
struct Present {
  std::vector<ts_body> bodies;      // body in each slot; 0 for an empty slot
  std::vector<uint32_t> colliders;  // serial number of each collider; 0 for an empty row
};

class Events {
 public:
  Events() = default;
  Events(const Archive& archive, size_t slots);

  int32_t kinds() const { return kinds_; }
  bool looks() const { return looks_for(kinds_); }
  static bool looks_for(int32_t kinds) {
    return (kinds & (TS_CONTACT_BEGAN | TS_CONTACT_ENDED | TS_FELL_ASLEEP | TS_WOKE)) != 0;
  }
  // Starts to record from the current state. If `looks_for(kinds)` is true, `status` must be up to date.
  void record(int32_t kinds, const Present& present);
  bool senses() const { return (kinds_ & kSensors) != 0; }
  // `inside`: slot of each body in a sensor, with the number of the sensor, ascending.
  void take_down(const std::map<Pair, std::array<float, 3>>& touches,
                 const std::vector<std::pair<int32_t, int32_t>>& inside, const Present& present,
                 const std::vector<int32_t>& frozen, int64_t step, double time, double dt);
  // Makes the contacts for which `may_touch` is false end in the next step.
  void end_unless(const std::function<bool(const Contact&)>& may_touch);
  void tell(ts_event event);  // adds an event, if its kind is recorded
  void lose(int64_t count) { dropped_ += count; }
  size_t drain(ts_event* events, size_t capacity);
  int64_t dropped() const { return dropped_; }

  // State on which later events depend.
  struct Memory {
    int32_t kinds;
    std::vector<int32_t> status;
    std::vector<ts_body> sleepers;
    std::vector<Contact> contacts;
    std::vector<Inside> inside;
  };
  Memory memory() const;
  // Drops waiting events of later steps, because the world was restored to the step count `steps`.
  void recall(const Memory& memory, int64_t steps, const Present& present);
  size_t contact_count() const { return (kinds_ & kContacts) != 0 ? going_on_.size() : 0; }
  size_t inside_count() const { return senses() ? inside_.size() : 0; }

  std::vector<int32_t> status;  // status after the last step, by slot; then two numbers, see `read_touches`
  size_t touch_rows = 0;        // largest number of touching pairs in any step

 private:
  static constexpr int32_t kContacts = TS_CONTACT_BEGAN | TS_CONTACT_ENDED, kSleep = TS_FELL_ASLEEP | TS_WOKE;
  static constexpr int32_t kSensors = TS_ENTERED | TS_LEFT;
  void follow(const std::map<Pair, std::array<float, 3>>& touches, const Present& present, int64_t step, double time,
              double dt);
  void sense(const std::vector<std::pair<int32_t, int32_t>>& inside, const Present& present, int64_t step,
             double time);
  std::vector<ts_body> sleeping(const Present& present) const;

  int32_t kinds_ = 0;
  double pause_ = 0.0;
  size_t most_ = 0;
  std::map<Pair, Contact> going_on_;
  std::vector<Inside> inside_;  // bodies in sensors after the last step, sorted by slot and sensor
  std::vector<ts_body> sleepers_;  // by slot, 0 if no sleeping body occupies it
  std::deque<ts_event> waiting_;
  int64_t dropped_ = 0;
};

}  // namespace taichi_soft
