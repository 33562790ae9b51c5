#include <algorithm>
#include <cstddef>
#include <cstring>
#include <map>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

uint32_t bits_of(float number) {
  uint32_t bits;
  std::memcpy(&bits, &number, sizeof bits);
  return bits;
}

}  // namespace

uint64_t World::hash() const {
  // Bit-identical to `hash_bodies` in taichi_soft/persistence/kernels/packing.py.
  uint64_t code = 1469598103934665603u;
  const auto mix = [&code](uint64_t word) {
    code = (code ^ word) * 1099511628211u;
    code ^= code >> 29;
  };
  const auto mix_two = [&mix](uint32_t x, uint32_t y) { mix(uint64_t(x) | uint64_t(y) << 32); };
  for (int32_t body = 0; body < scene_->slot_count; ++body) {
    mix(uint32_t(fields_.body_status(body)));
    if (fields_.body_status(body) == kAbsent) continue;
    mix_two(bits_of(fields_.body_velocity_lag(body)), uint32_t(fields_.body_drives(body)));
    mix_two(bits_of(fields_.body_gravity_scale(body)), bits_of(fields_.body_damping(body)));
    const size_t begin = begin_of(body), end = begin + asset_of(body).vertex_count();
    if (has_origin(body)) {
      for (size_t p = begin; p < end; ++p) {
        const std::array<float, 3> local = local_position(body, p);
        for (float each : local) mix(bits_of(each));
      }
    }
    for (size_t p = begin; p < end; ++p) {
      for (int k = 0; k < 3; ++k)
        mix_two(bits_of(fields_.particle_position(p, k)), bits_of(fields_.particle_velocity(p, k)));
      mix_two(bits_of(fields_.particle_inv_mass(p)), uint32_t(fields_.particle_aim(p)));
    }
  }
  return code;
}

constexpr uint64_t kSnapshotMark = 0x3550414E53534354u;

// Header of a snapshot. The following parts are, in this order: levels of detail; fields; frames, with attached
// vertices and reported loads; generations of handles; colliders; state of events.
struct SnapshotHead {
  uint64_t mark, size;
  uint32_t scene, sum;
  int64_t steps;
  uint64_t frames, colliders, contacts, inside, joint_rows, motor_rows, held;
  int64_t kinds;  // kinds of events that are recorded
  double time, last_dt;
  Surroundings surroundings;
};

namespace {

template <typename Part>
void put(char** at, const Part* data, size_t count) {
  if (count == 0) return;  // memcpy must not receive a null pointer
  std::memcpy(*at, data, count * sizeof(Part));
  *at += count * sizeof(Part);
}

template <typename Part>
void take(const char** at, Part* data, size_t count) {
  if (count == 0) return;
  std::memcpy(data, *at, count * sizeof(Part));
  *at += count * sizeof(Part);
}

template <typename Part>
void put_all(char** at, const std::vector<Part>& parts) {
  put(at, parts.data(), parts.size());
}

template <typename Part>
void take_all(const char** at, std::vector<Part>* parts) {
  take(at, parts->data(), parts->size());
}

bool is_place(const Pose& pose) {
  return length_of(pose.position) <= 1e9 && std::fabs(length_of(pose.rotation) - 1.0) <= 1e-3;
}

constexpr size_t kFrameSize = 2 * kFrameWidth * sizeof(float) + 1;

size_t count_of(const KeptField& each, const SnapshotHead& head) {
  const uint64_t rows[] = {1, head.joint_rows, head.motor_rows};
  return each.count * size_t(rows[each.whose]);
}

size_t size_of_fields(const SnapshotHead& head, const std::vector<KeptField>& kept) {
  size_t words = 0;
  for (const KeptField& each : kept) words += count_of(each, head) * each.place.width;
  return 4 * words;
}

// Size of the levels, the counts of held vertices, and the held vertices [bytes].
size_t size_of_levels(const SnapshotHead& head, size_t slots) {
  return sizeof(int32_t) * (2 * slots + size_t(head.held));
}

// Size of the parts after the fields [bytes].
size_t size_of_rest(const SnapshotHead& head, size_t slots, size_t particles) {
  return kFrameSize * head.frames + (1 + sizeof(int32_t) + sizeof(float)) * particles +
         sizeof(uint32_t) * (slots + kMostGrabs + kMostJoints + kMostMotors) + sizeof(double) * slots +
         sizeof(Collider) * head.colliders + sizeof(int32_t) * (slots + 2) + sizeof(ts_body) * slots +
         sizeof(Contact) * head.contacts + sizeof(Inside) * head.inside;
}

}  // namespace

// Levels for a snapshot, which contains only the levels of existing bodies.
World::Levels World::present_levels() const {
  Levels found;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    const bool lives = fields_.body_status(slot) != kAbsent;
    found.levels.push_back(lives ? level_of(slot) : 0);
    found.held.push_back(found.levels.back() != 0 ? held_[size_t(slot)] : std::vector<int32_t>());
  }
  return found;
}

size_t World::Levels::held_count() const {
  size_t count = 0;
  for (const auto& each : held) count += each.size();
  return count;
}

// Reads levels and advances `at`. Returns: false if they are invalid.
bool World::parse_levels(const char** at, const SnapshotHead& head, Levels* found) const {
  const size_t slots = size_t(scene_->slot_count);
  std::vector<int32_t> counts(slots);
  found->levels.resize(slots);
  take_all(at, &found->levels);
  take_all(at, &counts);
  size_t left = size_t(head.held);
  for (size_t slot = 0; slot < slots; ++slot) {
    if (found->levels[slot] < 0 || size_t(found->levels[slot]) >= whole_of(int32_t(slot)).level_count()) return false;
    if (counts[slot] < 0 || size_t(counts[slot]) > left) return false;
    left -= size_t(counts[slot]);
    found->held.emplace_back(size_t(counts[slot]));
    take_all(at, &found->held.back());
    if (!are_held(int32_t(slot), found->held.back())) return false;
  }
  return left == 0;
}

size_t World::snapshot_size() const {
  SnapshotHead head{};
  head.held = present_levels().held_count();
  head.frames = frame_alive_.size(), head.colliders = colliders_.rows.size();
  head.contacts = events_.contact_count(), head.inside = events_.inside_count();
  head.joint_rows = joint_rows(), head.motor_rows = motor_rows();
  return sizeof head + size_of_levels(head, size_t(scene_->slot_count)) + size_of_fields(head, scene_->kept) +
         size_of_rest(head, size_t(scene_->slot_count), feels_.size());
}

void World::snapshot(char* bytes) const {
  const Events::Memory memory = events_.memory();
  SnapshotHead head{};
  head.mark = kSnapshotMark, head.size = snapshot_size(), head.scene = scene_->code;
  head.frames = frame_alive_.size(), head.colliders = colliders_.rows.size();
  head.contacts = memory.contacts.size(), head.inside = memory.inside.size(), head.kinds = memory.kinds;
  head.joint_rows = joint_rows(), head.motor_rows = motor_rows();
  head.steps = steps_, head.time = time_, head.last_dt = last_dt_;
  head.surroundings = surroundings_;
  char* at = bytes + sizeof head;
  const Levels levels = present_levels();
  head.held = levels.held_count();
  put_all(&at, levels.levels);
  for (const auto& each : levels.held) {
    const int32_t count = int32_t(each.size());
    put(&at, &count, 1);
  }
  for (const auto& each : levels.held) put_all(&at, each);
  for (const KeptField& each : scene_->kept) {
    const char* row = machine_->root() + each.place.offset;
    const size_t count = count_of(each, head);
    for (size_t i = 0; i < count; ++i, row += each.place.stride) put(&at, row, 4 * each.place.width);
  }
  put_all(&at, present_);
  put_all(&at, coming_);
  put_all(&at, frame_alive_);
  put_all(&at, feels_);
  put_all(&at, attachments_);
  put_all(&at, break_forces_);
  put_all(&at, generations_);
  put_all(&at, grab_generations_);
  put_all(&at, joint_generations_);
  put_all(&at, motor_generations_);
  put_all(&at, friction_);
  for (const Collider& each : colliders_.rows) {
    Collider row;
    std::memset(static_cast<void*>(&row), 0, sizeof row);  // makes padding deterministic
    row = each;
    put(&at, &row, 1);
  }
  put_all(&at, memory.status);
  put_all(&at, memory.sleepers);
  put_all(&at, memory.contacts);
  put_all(&at, memory.inside);
  std::memcpy(bytes, &head, sizeof head);
  head.sum = checksum(bytes, head.size);  // checksum of the bytes with `sum` equal to 0
  std::memcpy(bytes, &head, sizeof head);
}

bool World::is_valid(const Contact& contact, size_t colliders) const {
  const auto is_below = [](int32_t number, size_t limit) { return number >= 0 && size_t(number) < limit; };
  const size_t slots = size_t(scene_->slot_count);
  for (double each :
       {contact.began, contact.touched, contact.pause, contact.impulse[0], contact.impulse[1], contact.impulse[2]}) {
    if (!std::isfinite(each)) return false;
  }
  return is_below(contact.slot, slots) && (contact.kind == kOfBody || contact.kind == kOfCollider) &&
         is_below(contact.other, contact.kind == kOfBody ? slots : colliders);
}

bool World::is_valid(const Inside& inside, size_t colliders) const {
  return inside.slot >= 0 && inside.slot < scene_->slot_count && inside.sensor >= 0 &&
         size_t(inside.sensor) < colliders;
}

// Fields in a snapshot, found by their offsets in a world's memory.
class World::Packed {
 public:
  Packed(const World& world, const char* at, const SnapshotHead& head, const std::vector<int32_t>& levels)
      : levels_(levels) {
    for (const KeptField& each : world.scene().kept) {
      rows_[each.place.offset] = {at, each.place.width};
      at += 4 * count_of(each, head) * each.place.width;
    }
    status_ = rows_.at(world.scene().place("body_status").offset).first;
  }
  template <typename Number = int32_t>
  Number number(const Place& place, size_t row, size_t column = 0) const {
    const auto& [at, width] = rows_.at(place.offset);
    Number found;
    std::memcpy(&found, at + 4 * (row * width + column), sizeof found);
    return found;
  }
  int32_t level(int32_t slot) const { return levels_[size_t(slot)]; }
  // True if the slot `body - 1` contains a body.
  bool lives(int32_t body) const {
    int32_t status;
    std::memcpy(&status, status_ + 4 * (body - 1), sizeof status);
    return status != kAbsent;
  }

 private:
  std::map<size_t, std::pair<const char*, size_t>> rows_;
  const char* status_;
  const std::vector<int32_t>& levels_;
};

bool World::lies_in(int32_t particle, int32_t slot, int32_t level) const {
  const size_t begin = begin_of(slot), p = size_t(particle);
  return p >= begin && p < begin + whole_of(slot).level(size_t(level)).vertex_count();
}

// True if the joints are consistent. The caller has already checked the indices of bodies and particles.
bool World::are_joints_valid(const Packed& packed, const SnapshotHead& head) const {
  const Scene& s = *scene_;
  const Place bodies = s.place("joints.bodies"), rows = s.place("joints.rows");
  const Place particle = s.place("joints.particle"), weight = s.place("joints.weight");
  std::vector<std::pair<size_t, size_t>> spans;
  for (size_t j = 0; j < kMostJoints; ++j) {
    const int32_t a = packed.number(bodies, j, 0), b = packed.number(bodies, j, 1);
    if (a == 0) continue;
    const size_t first = size_t(packed.number(rows, j, 0)), end = size_t(packed.number(rows, j, 1));
    if (b == 0 || a == b || !packed.lives(a) || !packed.lives(b) || first >= end || end > head.joint_rows) return false;
    spans.push_back({first, end});
    for (size_t i = kJointEnds * first; i < kJointEnds * end; ++i) {
      const int32_t slot = (i % kJointEnds < kJointEnds / 2 ? a : b) - 1;
      if (!lies_in(packed.number(particle, i), slot, packed.level(slot))) return false;
      if (!(std::fabs(packed.number<float>(weight, i)) < 1e3f)) return false;
    }
  }
  std::sort(spans.begin(), spans.end());
  size_t next = 0;
  for (const auto& span : spans) {
    if (span.first != next) return false;
    next = span.second;
  }
  return next == head.joint_rows;
}

bool World::are_motors_valid(const Packed& packed, const SnapshotHead& head) const {
  const Scene& s = *scene_;
  const Place body = s.place("motors.motor.body"), first = s.place("motors.motor.first"),
              end = s.place("motors.motor.end"), axis = s.place("motors.motor.axis"),
              particle = s.place("motors.particle");
  size_t next = 0;
  for (size_t m = 0; m < kMostMotors; ++m) {
    const int32_t who = packed.number(body, m);
    if (who == 0) continue;
    const int64_t from = packed.number(first, m), to = packed.number(end, m);
    if (!packed.lives(who) || from != int64_t(next) || to <= from || to > int64_t(head.motor_rows)) {
      return false;
    }
    Vector direction;
    for (size_t k = 0; k < 3; ++k) direction[k] = packed.number<float>(axis, m, k);
    if (!(length_of(direction) <= 1.001)) return false;
    for (next = size_t(from); next < size_t(to); ++next) {
      if (!lies_in(packed.number(particle, next), who - 1, packed.level(who - 1))) return false;
    }
  }
  return next == head.motor_rows;
}

// True if all indices are in range and all values are finite, so that a step is safe.
bool World::are_rows_valid(const char* at, const SnapshotHead& head) const {
  const Scene& s = *scene_;
  const int64_t counts[] = {0, s.particle_count, s.slot_count, int64_t(collider_room_), int64_t(head.frames)};
  Levels levels;
  if (!parse_levels(&at, head, &levels)) return false;
  const Packed packed(*this, at, head, levels.levels);
  for (const KeptField& each : s.kept) {
    const int64_t end = each.bound == nullptr ? 0 : counts[each.bound->things] + each.bound->beside;
    const float most = each.bound == nullptr ? kAny : each.bound->most;
    for (size_t i = 0; i < count_of(each, head) * each.place.width; ++i) {
      if (each.place.is_whole) {
        int32_t number;
        take(&at, &number, 1);
        if (end > 0 && (number < 0 || number >= end)) return false;
      } else {
        float number;
        take(&at, &number, 1);
        if (std::isfinite(most) && !(std::fabs(number) <= most)) return false;
      }
    }
  }
  if (!are_joints_valid(packed, head) || !are_motors_valid(packed, head)) return false;
  for (size_t i = 0; i < 2 * kFrameWidth * head.frames; ++i) {
    float number;
    take(&at, &number, 1);
    if (!(std::fabs(number) <= s.position_limit)) return false;
  }
  at += head.frames + feels_.size() + (sizeof(int32_t) + sizeof(float)) * attachments_.size() +
        sizeof(uint32_t) * (generations_.size() + kMostGrabs + kMostJoints + kMostMotors);
  std::vector<double> frictions(friction_.size());
  take_all(&at, &frictions);
  if (!are_frictions(frictions.data(), frictions.size())) return false;
  for (size_t i = 0; i < head.colliders; ++i) {
    unsigned char flags[3];
    std::memcpy(flags, at + offsetof(Collider, is_alive), 1);
    std::memcpy(flags + 1, at + offsetof(Collider, has_target), 1);
    std::memcpy(flags + 2, at + offsetof(Collider, is_sensor), 1);
    if (flags[0] > 1 || flags[1] > 1 || flags[2] > 1) return false;
    Collider row;
    take(&at, &row, 1);
    // Only exported colliders have the grid that height fields and meshes need.
    const bool is_known =
        row.kind >= 0 && (row.kind <= TS_CAPSULE || (i < s.names(TS_COLLIDER).size() && row.kind <= kMeshShape));
    if (!is_known || !is_place(row.pose) || (row.has_target && !is_place(row.target)) ||
        !std::isfinite(length_of(row.velocity)) || !std::isfinite(length_of(row.spin)) ||
        !(length_of(row.surface_velocity) < 2.0 * s.velocity_limit)) {
      return false;
    }
  }
  at += sizeof(int32_t) * events_.status.size() + sizeof(ts_body) * generations_.size();
  for (size_t i = 0; i < head.contacts; ++i) {
    Contact contact;
    take(&at, &contact, 1);
    if (!is_valid(contact, size_t(head.colliders))) return false;
  }
  for (size_t i = 0; i < head.inside; ++i) {
    Inside inside;
    take(&at, &inside, 1);
    if (!is_valid(inside, size_t(head.colliders))) return false;
  }
  return true;
}

// Checks the initial state in the world file, as `restore` checks a snapshot.
void World::require_image() const {
  std::vector<char> bytes(snapshot_size());
  snapshot(bytes.data());
  SnapshotHead head;
  std::memcpy(&head, bytes.data(), sizeof head);
  if (!is_valid(head.surroundings) || !are_rows_valid(bytes.data() + sizeof head, head)) {
    fail(TS_ERROR_FILE, "the world file is invalid: its state refers to missing objects. Export it again");
  }
}

void World::restore(const char* bytes, size_t size) {
  SnapshotHead head;
  if (size < sizeof head) fail(TS_ERROR_SNAPSHOT, "%zu bytes are not a snapshot", size);
  std::memcpy(&head, bytes, sizeof head);
  if (head.mark != kSnapshotMark) fail(TS_ERROR_SNAPSHOT, "these bytes are not a snapshot");
  if (head.scene != scene_->code) fail(TS_ERROR_SNAPSHOT, "this snapshot belongs to another world file");
  const size_t slots = size_t(scene_->slot_count);
  if (head.joint_rows > kJointRows || head.motor_rows > kMotorRows) fail(TS_ERROR_SNAPSHOT, "this snapshot is cut off");
  if (head.held > slots * size_t(scene_->particle_count)) fail(TS_ERROR_SNAPSHOT, "this snapshot is cut off");
  const size_t fields = sizeof head + size_of_levels(head, slots) + size_of_fields(head, scene_->kept);
  if (head.size != size || head.frames == 0 || head.frames > kMostFrames || head.colliders > collider_room_ ||
      head.contacts > slots * events_.touch_rows || head.inside > slots * collider_room_ ||
      size != fields + size_of_rest(head, slots, feels_.size()) || (head.kinds & ~int64_t(TS_ALL_EVENTS)) != 0 ||
      head.steps < 0 || !std::isfinite(head.time) || !std::isfinite(head.last_dt)) {
    fail(TS_ERROR_SNAPSHOT, "this snapshot is cut off");
  }
  const uint32_t sum = head.sum;
  head.sum = 0;
  const uint32_t of_head = checksum(reinterpret_cast<const char*>(&head), sizeof head);
  if (sum != checksum(bytes + sizeof head, size - sizeof head, of_head)) {
    fail(TS_ERROR_SNAPSHOT, "this snapshot is damaged: its checksum is wrong");
  }
  if (!is_valid(head.surroundings) || !are_rows_valid(bytes + sizeof head, head)) {
    fail(TS_ERROR_SNAPSHOT, "this snapshot is invalid: it refers to missing objects");
  }
  // Allocate before the world is changed, so that a failed allocation changes nothing.
  const size_t frames = size_t(head.frames);
  Events::Memory memory = {int32_t(head.kinds), std::vector<int32_t>(slots + 2), std::vector<ts_body>(slots),
                           std::vector<Contact>(size_t(head.contacts)), std::vector<Inside>(size_t(head.inside))};
  present_.reserve(kFrameWidth * frames), coming_.reserve(kFrameWidth * frames), frame_alive_.reserve(frames);
  colliders_.rows.reserve(size_t(head.colliders));
  const char* at = bytes + sizeof head;
  Levels levels;
  parse_levels(&at, head, &levels);
  const Packed packed(*this, at, head, levels.levels);
  machine_->launch("forget_held", {});
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    if (packed.lives(slot + 1) && levels.levels[size_t(slot)] != level_of(slot))
      refill(slot, levels.levels[size_t(slot)]);
  }
  held_ = std::move(levels.held);
  for (const KeptField& each : scene_->kept) {
    char* row = machine_->root() + each.place.offset;
    const size_t count = count_of(each, head);
    for (size_t i = 0; i < count; ++i, row += each.place.stride) take(&at, row, 4 * each.place.width);
  }
  present_.resize(kFrameWidth * frames), coming_.resize(kFrameWidth * frames), frame_alive_.resize(frames);
  take_all(&at, &present_);
  take_all(&at, &coming_);
  take_all(&at, &frame_alive_);
  take_all(&at, &feels_);
  take_all(&at, &attachments_);
  take_all(&at, &break_forces_);
  take_all(&at, &generations_);
  take_all(&at, &grab_generations_);
  take_all(&at, &joint_generations_);
  take_all(&at, &motor_generations_);
  take_all(&at, &friction_);
  colliders_.rows.resize(size_t(head.colliders));
  take_all(&at, &colliders_.rows);
  take_all(&at, &memory.status);
  take_all(&at, &memory.sleepers);
  take_all(&at, &memory.contacts);
  take_all(&at, &memory.inside);
  write_colliders();
  mark_driven();
  joints_have_changed();
  surroundings_ = head.surroundings;
  write_surroundings();
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) give_friction(slot, friction_[size_t(slot)]);
  steps_ = head.steps, time_ = head.time, last_dt_ = head.last_dt;
  colliders_.is_dirty = has_work_ = true;
  is_still_ = false;
  rows_at_ = -1.0;
  if (events_.looks() && !Events::looks_for(memory.kinds)) look();
  events_.recall(memory, steps_, present());
}

}  // namespace taichi_soft
