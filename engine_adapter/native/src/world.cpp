#include "world.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "error.hpp"

namespace taichi_soft {

namespace {

constexpr double kRoundOff = 1e-9;  // [steps], equal to ROUND_OFF in engine_adapter/fixed_step.py
constexpr int32_t kMostThreads = 256;
constexpr int32_t kAll = std::numeric_limits<int32_t>::max();

}  // namespace

World::World(std::shared_ptr<Scene> scene) : scene_(std::move(scene)), machine_(std::make_unique<Machine>(*scene_)) {
  const Archive& archive = scene_->archive;
  const auto clock = archive.get<double>("world/clock");
  const auto steps = archive.get<int64_t>("world/steps");
  const auto surroundings = archive.get<double>("world/surroundings");
  const auto poses = archive.get<float>("frames/poses");
  const size_t frames = poses.count / (2 * kFrameWidth), named = scene_->names(TS_FRAME).size();
  const auto alive = archive.get<int32_t>("frames/alive");
  const auto feels = archive.get<unsigned char>("frames/feels");
  if (clock.count != 2 || steps.count != 1 || surroundings.count != 4 || poses.count != 2 * kFrameWidth * frames ||
      frames == 0 || named > frames || alive.count != named || feels.count != size_t(scene_->particle_count)) {
    fail(TS_ERROR_FILE, "the world file is invalid: clock, surroundings or frames. Export it again");
  }
  steps_ = steps[0], time_ = clock[0], last_dt_ = clock[1];
  surroundings_ = {{surroundings[0], surroundings[1], surroundings[2]}, surroundings[3], scene_->floor};
  const auto frictions = archive.get<double>("slots/friction");
  friction_.assign(frictions.begin(), frictions.end());
  if (friction_.size() != size_t(scene_->slot_count)) {
    fail(TS_ERROR_FILE, "the world file is invalid: frictions. Export it again");
  }
  present_.assign(poses.data, poses.data + kFrameWidth * frames);
  coming_.assign(poses.data + kFrameWidth * frames, poses.data + 2 * kFrameWidth * frames);
  frame_alive_.assign(frames, 0);  // without frames, there is one unused row
  std::copy(alive.begin(), alive.end(), frame_alive_.begin());
  feels_.assign(feels.begin(), feels.end());
  colliders_ = Colliders(archive);
  events_ = Events(archive, size_t(scene_->slot_count));
  generations_.assign(size_t(scene_->slot_count), 1);
  grab_generations_.assign(kMostGrabs, 1);
  joint_generations_.assign(kMostJoints, 1);
  motor_generations_.assign(kMostMotors, 1);
  bind();
  read_levels();
  require_image();
}

void World::bind() {
  collider_room_ = scene_->place("colliders.kind", colliders_.rows.size()).count;
  fields_ = Fields(machine_->root(), *scene_, collider_room_);
  if (scene_->patch_rows != kPatchRows) fail(TS_ERROR_FILE, "the world file is invalid: grabs. Export it again");
  // The kernel that reads contacts does not check the number of rows.
  if (events_.touch_rows < size_t(scene_->slot_count) * (collider_room_ + (scene_->has_soft_contact ? kPairRows : 0))) {
    fail(TS_ERROR_FILE, "the world file is invalid: events. Export it again");
  }
}

// ---- steps ----

void World::require_step(double dt) const {
  if (!(dt >= scene_->shortest_step && dt <= scene_->longest_step)) {
    fail(TS_ERROR_ARGUMENT, "dt is %g s: give %g to %g", dt, scene_->shortest_step, scene_->longest_step);
  }
}

void World::set_fixed_step(double dt, int32_t substeps, int32_t max_steps) {
  require_step(dt);
  if (max_steps < 1 || max_steps > 1000000) fail(TS_ERROR_ARGUMENT, "max_steps is %d: give 1 to 1,000,000", max_steps);
  require_substeps(dt, substeps);
  dt_ = dt, substeps_ = substeps, max_steps_ = max_steps;
  remainder_ = 0.0;
  picture_ = 1.0;
}

int32_t World::require_substeps(double dt, int32_t substeps) const {
  if (substeps < 0 || substeps > 1000000) {
    fail(TS_ERROR_ARGUMENT, "substeps is %d: give 1 to 1,000,000, or 0 for a stable number", substeps);
  }
  const int32_t stable = stable_substeps(dt);
  return substeps == 0 ? stable : substeps;
}

int32_t World::stable_substeps(double dt) const {
  require_step(dt);
  const double count = std::ceil(scene_->stable_share * dt / scene_->stable_step);
  if (count > 1e6) fail(TS_ERROR_ARGUMENT, "dt is %g s, which takes %g substeps: give less", dt, count);
  return std::max(1, static_cast<int32_t>(count));
}

bool World::aim_pins(double dt) {
  const std::vector<float> before = std::exchange(present_, coming_);
  if (!has_work_) return false;
  const uint32_t frames = static_cast<uint32_t>(coming_.size() / kFrameWidth);
  float* rows = machine_->frames.room<float>(2 * coming_.size());
  std::copy(before.begin(), before.end(), std::copy(coming_.begin(), coming_.end(), rows));
  machine_->launch("aim_pinned", {Machine::whole(scene_->slot_count), Machine::real(dt),
                                  Machine::array(machine_->frames, 2 * frames, kFrameWidth)});
  has_work_ = false;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    const bool is_on = fields_.body_status(slot) <= kAbsent;
    has_work_ = has_work_ || (is_on && (fields_.body_drives(slot) & kMovesPins) != 0);
  }
  return has_work_;
}

bool World::prepare_colliders(double dt) {
  if (!colliders_.prepare(dt, &motion_)) return false;
  for (size_t c = 0; c < motion_.size(); ++c) {
    const ColliderMotion& m = motion_[c];
    for (int k = 0; k < 3; ++k) {
      fields_.colliders.position(c, k) = m.position[k];
      fields_.colliders.position_residue(c, k) = m.residue[k];
      fields_.colliders.velocity(c, k) = m.velocity[k];
      fields_.colliders.spin(c, k) = m.spin[k];
      fields_.colliders.lower(c, k) = m.lower[k];
      fields_.colliders.upper(c, k) = m.upper[k];
    }
    for (int k = 0; k < 4; ++k) fields_.colliders.rotation(c, k) = m.rotation[k];
    fields_.colliders.speed(c) = m.speed;
  }
  return true;
}

void World::step(double dt, int32_t substeps) {
  require_step(dt);
  const int32_t count = require_substeps(dt, substeps);
  bool goes_on = !is_still_;
  goes_on = aim_pins(dt) || goes_on;
  goes_on = prepare_colliders(dt) || goes_on;
  std::vector<int32_t> frozen;
  if (goes_on) {
    rows_at_ = -1.0;
    std::vector<int32_t> others;
    const int32_t watched = (events_.kinds() & TS_FROZE) != 0 ? scene_->slot_count : 0;
    for (int32_t slot = 0; slot < watched; ++slot) {
      if (fields_.body_status(slot) != kFrozen) others.push_back(slot);
    }
    launch_step(count, dt / count);
    for (int32_t slot : others) {
      if (fields_.body_status(slot) == kFrozen) frozen.push_back(slot);
    }
  }
  colliders_.finish(dt);
  steps_ += 1;
  time_ += dt;
  last_dt_ = dt;
  picture_ = 1.0;
  take_down(dt, frozen);
  if (goes_on) {
    break_joints(dt);
    break_attachments(dt);
  }
}

void World::set_threads(int32_t count) {
  if (count < 1 || count > kMostThreads) {
    fail(TS_ERROR_ARGUMENT, "count is %d: give the number of threads, 1 to %d", count, kMostThreads);
  }
  machine_->threads.set_most(count);
}

void World::launch_step(int32_t substeps, double h) {
  const int32_t bodies = scene_->slot_count;
  const int32_t helpers = std::min(machine_->threads.most(), bodies) - 1;
  machine_->launch("step", {Machine::whole(bodies), Machine::whole(helpers), Machine::whole(substeps), Machine::real(h),
                            Machine::whole(kAll), Machine::whole(0)});
  int32_t busy = 0;
  for (int32_t island = 0; island < fields_.islands.count(0); ++island)
    busy += fields_.progress.failed(island) + fields_.progress.is_awake(island);
  is_still_ = busy == 0;
}

int32_t World::steps_due(double seconds) {
  if (!(seconds >= 0.0 && seconds < 1e9)) {
    fail(TS_ERROR_ARGUMENT, "seconds is %g: give the time of a frame, 0 or more", seconds);
  }
  const double waiting = remainder_ + seconds;
  const double due = waiting / dt_ + kRoundOff;
  if (due >= double(max_steps_) + 1.0) {
    remainder_ = 0.0;
    dropped_ += waiting - max_steps_ * dt_;
    return steps_left_ = max_steps_;
  }
  const int32_t steps = static_cast<int32_t>(due);
  remainder_ = waiting - steps * dt_;
  return steps_left_ = steps;
}

double World::alpha() const { return std::max(remainder_ / dt_, 0.0); }

void World::step_in_time() {
  step(dt_, substeps_);
  --steps_left_;
}

void World::end_frame() {
  dropped_ += steps_left_ * dt_;
  steps_left_ = 0;
  picture_ = alpha();
  advancing = ThreadId();
}

void World::write_clock(ts_clock* clock, int32_t steps_made) const {
  clock->steps_made = steps_made;
  clock->steps = steps_;
  clock->time = time_;
  clock->alpha = alpha();
  clock->dropped = dropped_;
}

// ---- sleep ----

void World::mark_modified(int32_t slot) {
  wake_slot(slot);
  rows_at_ = -1.0;
}

void World::wake_slot(int32_t slot) {
  is_still_ = false;
  if (scene_->sleeps) machine_->launch("wake_body", {Machine::whole(slot)});
}

void World::wake_near(const Box& box) {
  if (!scene_->sleeps) return;
  float* numbers = machine_->numbers.room<float>(6);
  for (int k = 0; k < 3; ++k) numbers[k] = as_float(box.lower[k]), numbers[3 + k] = as_float(box.upper[k]);
  machine_->launch("wake_near", {Machine::whole(scene_->slot_count), Machine::array(machine_->numbers, 6)});
  is_still_ = false;
}

// Box around a body and its contact surface.
Box World::box_of(int32_t slot) const {
  const Asset& asset = asset_of(slot);
  std::vector<Vector> points(asset.vertex_count());
  for (size_t v = 0; v < points.size(); ++v) points[v] = vertex_place(slot, int32_t(v));
  if (asset.hull.count > 0) {
    const std::vector<Vector> hull = touching_points(asset, points);
    points.insert(points.end(), hull.begin(), hull.end());
  }
  Box box;
  for (int k = 0; k < 3; ++k) {
    box.lower[k] = std::numeric_limits<double>::infinity();
    box.upper[k] = -box.lower[k];
    for (const Vector& each : points) {
      box.lower[k] = std::min(box.lower[k], each[k]);
      box.upper[k] = std::max(box.upper[k], each[k]);
    }
    box.lower[k] = box.lower[k] - asset.thickness;
    box.upper[k] = box.upper[k] + asset.thickness;
  }
  return box;
}

void World::wake() { mark_modified(-1); }

}  // namespace taichi_soft
