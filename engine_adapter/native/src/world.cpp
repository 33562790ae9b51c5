#include "world.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "error.hpp"

namespace taichi_soft {

namespace {

// As taichi_soft/bodies/status.py has them.
enum Status { kActive, kFrozen, kAsleep, kSkipping, kAbsent };
enum Drives { kMovesPins = 1, kDamped = 8, kSheltered = 16, kGrabbed = 32, kJoined = 64 };
constexpr int32_t kWithFrame = 3;

constexpr ts_body kBody = uint64_t(3) << 56;  // what a body's handle begins with, and no other handle

constexpr double kRoundOff = 1e-9;  // of a step, as in engine_adapter/fixed_step.py
constexpr int32_t kAll = std::numeric_limits<int32_t>::max();

const char* const kColliderFields[] = {"position", "rotation", "velocity", "spin", "lower", "upper", "speed"};

float as_float(double number) { return static_cast<float>(number); }

uint32_t bits_of(float number) {
  uint32_t bits;
  std::memcpy(&bits, &number, sizeof bits);
  return bits;
}

}  // namespace

World::World(std::shared_ptr<Scene> scene) : scene_(std::move(scene)), machine_(scene_->take_machine()) {
  const Archive& archive = scene_->archive;
  const auto image = archive.get<unsigned char>("fields/image");
  std::memcpy(machine_->root(), image.data, image.count);
  const auto clock = archive.get<double>("world/clock");
  const auto steps = archive.get<int64_t>("world/steps");
  const auto poses = archive.get<float>("frames/poses");
  const size_t frames = poses.count / 24, named = scene_->names(TS_FRAME).size();
  const auto alive = archive.get<int32_t>("frames/alive");
  if (clock.count != 2 || steps.count != 1 || poses.count != 24 * frames || frames == 0 || named > frames ||
      alive.count != named) {
    fail(TS_ERROR_FILE, "the world file is not in order: clock or frames. Export it again");
  }
  steps_ = steps[0], time_ = clock[0], last_dt_ = clock[1];
  frames_.assign(poses.data + 12 * frames, poses.data + 24 * frames);
  if (scene_->has_contact) colliders_ = Colliders(archive);
  generations_.assign(size_t(scene_->slot_count), 1);
  bind();
}

World::~World() {
  if (machine_) scene_->give_back(std::move(machine_));
}

void World::bind() {
  char* root = machine_->root();
  const Scene& s = *scene_;
  const size_t bodies = size_t(s.slot_count), particles = size_t(s.particle_count);
  body_status_ = {root, s.place("body_status", bodies, 1)};
  body_drives_ = {root, s.place("body_drives", bodies, 1)};
  particle_aim_ = {root, s.place("particle_aim", particles, 1)};
  is_awake_ = {root, s.place("progress.is_awake", bodies, 1)};
  failed_ = {root, s.place("progress.failed", bodies, 1)};
  is_driven_ = {root, s.place("motors.is_driven", bodies, 1)};
  position_ = {root, s.place("particle_position", particles, 3)};
  velocity_ = {root, s.place("particle_velocity", particles, 3)};
  mass_ = {root, s.place("particle_mass", particles, 1)};
  inv_mass_ = {root, s.place("particle_inv_mass", particles, 1)};
  lag_ = {root, s.place("body_velocity_lag", bodies, 1)};
  gravity_scale_ = {root, s.place("body_gravity_scale", bodies, 1)};
  damping_ = {root, s.place("body_damping", bodies, 1)};
  wind_ = {root, s.place("wind", 1, 4)};
  if (!s.has_contact) return;
  island_count_ = {root, s.place("contact.island_count", 1, 1)};
  const size_t rows = colliders_.rows.size();
  const Place kind = s.place("contact.collider_kind", rows, 1);
  collider_kind_ = {root, kind};
  collider_room_ = kind.count;
  for (int i = 0; i < 7; ++i) {
    const size_t width = i == 1 ? 4 : i == 6 ? 1 : 3;
    collider_[i] = {root, s.place(std::string("contact.collider_") + kColliderFields[i], collider_room_, width)};
  }
  collider_parameters_ = {root, s.place("contact.collider_parameters", collider_room_, 8)};
  collider_surface_ = {root, s.place("contact.collider_surface", collider_room_, 3)};
  collider_filter_ = {root, s.place("contact.collider_filter", collider_room_, 2)};
  collider_count_ = {root, s.place("contact.collider_count", 1, 1)};
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
    fail(TS_ERROR_ARGUMENT, "substeps is %d: give 1 to 1,000,000, or 0 for what is stable", substeps);
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
  if (!has_work_) return false;
  const uint32_t frames = static_cast<uint32_t>(frames_.size() / 12);
  float* rows = machine_->frames.room<float>(machine_->runtime(), frames_.size());
  std::copy(frames_.begin(), frames_.end(), rows);
  machine_->launch("aim_pinned", {Machine::whole(scene_->slot_count), Machine::real(dt),
                                  Machine::array(machine_->frames.memory(), TI_DATA_TYPE_F32, frames, 12)});
  has_work_ = false;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    has_work_ = has_work_ || (body_drives_(slot) & kMovesPins) != 0;
  }
  return has_work_;
}

bool World::prepare_colliders(double dt) {
  if (!scene_->has_contact || !colliders_.prepare(dt, &motion_)) return false;
  for (size_t c = 0; c < motion_.size(); ++c) {
    const ColliderMotion& m = motion_[c];
    for (int k = 0; k < 3; ++k) {
      collider_[0](c, k) = m.position[k];
      collider_[2](c, k) = m.velocity[k];
      collider_[3](c, k) = m.spin[k];
      collider_[4](c, k) = m.lower[k];
      collider_[5](c, k) = m.upper[k];
    }
    for (int k = 0; k < 4; ++k) collider_[1](c, k) = m.rotation[k];
    collider_[6](c) = m.speed;
  }
  return true;
}

void World::step(double dt, int32_t substeps) {
  require_step(dt);
  const int32_t count = require_substeps(dt, substeps);
  bool goes_on = !is_still_;
  goes_on = aim_pins(dt) || goes_on;
  goes_on = prepare_colliders(dt) || goes_on;
  if (goes_on) {
    rows_at_ = -1.0;
    launch_step(count, dt / count);
  }
  if (scene_->has_contact) colliders_.finish(dt);
  steps_ += 1;
  time_ += dt;
  last_dt_ = dt;
  picture_ = 1.0;
}

void World::launch_step(int32_t substeps, double h) {
  const int32_t bodies = scene_->slot_count;
  std::vector<TiArgument> arguments = {Machine::whole(bodies)};
  if (scene_->has_contact) arguments.push_back(Machine::whole(std::min(scene_->threads, bodies) - 1));
  arguments.insert(arguments.end(),
                   {Machine::whole(substeps), Machine::real(h), Machine::whole(kAll), Machine::whole(0)});
  machine_->launch("step", arguments);
  is_still_ = false;
  if (scene_->has_contact) {
    int32_t busy = 0;
    for (int32_t island = 0; island < island_count_(0); ++island) busy += failed_(island) + is_awake_(island);
    is_still_ = busy == 0;
  }
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
    return max_steps_;
  }
  const int32_t steps = static_cast<int32_t>(due);
  remainder_ = waiting - steps * dt_;
  return steps;
}

double World::alpha() const { return std::max(remainder_ / dt_, 0.0); }

void World::end_frame(int32_t steps_left) {
  dropped_ += steps_left * dt_;
  picture_ = alpha();
}

void World::write_clock(ts_clock* clock, int32_t steps_made) const {
  clock->steps_made = steps_made;
  clock->steps = steps_;
  clock->time = time_;
  clock->alpha = alpha();
  clock->dropped = dropped_;
}

// ---- who sleeps ----

void World::rouse(int32_t slot) {
  wake_slot(slot);
  rows_at_ = -1.0;
}

void World::wake_slot(int32_t slot) {
  is_still_ = false;
  if (scene_->sleeps) machine_->launch("wake_body", {Machine::whole(slot)});
}

void World::wake_near(const Box& box) {
  if (!scene_->sleeps) return;
  float* numbers = machine_->numbers.room<float>(machine_->runtime(), 6);
  for (int k = 0; k < 3; ++k) numbers[k] = as_float(box.lower[k]), numbers[3 + k] = as_float(box.upper[k]);
  machine_->launch("wake_near", {Machine::whole(scene_->slot_count),
                                 Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 6)});
  is_still_ = false;
}

Box World::box_of(int32_t slot) const {
  const Asset& asset = asset_of(slot);
  Box box;
  for (int k = 0; k < 3; ++k) {
    box.lower[k] = std::numeric_limits<double>::infinity();
    box.upper[k] = -box.lower[k];
    for (size_t v = 0; v < asset.vertex_count(); ++v) {
      const double x = position_(particle(slot, v), k);
      box.lower[k] = std::min(box.lower[k], x);
      box.upper[k] = std::max(box.upper[k], x);
    }
    box.lower[k] = box.lower[k] - asset.thickness;
    box.upper[k] = box.upper[k] + asset.thickness;
  }
  return box;
}

void World::wake() { rouse(-1); }

// ---- bodies ----

ts_body World::body_in(int32_t slot) const {
  if (slot < 0 || slot >= scene_->slot_count) {
    fail(TS_ERROR_ARGUMENT, "slot is %d: there are %d, from 0", slot, scene_->slot_count);
  }
  return body_status_(slot) == kAbsent ? 0 : kBody | ts_body(generations_[slot]) << 32 | uint32_t(slot + 1);
}

int32_t World::slot_of(ts_body body) const {
  const int64_t slot = int64_t(body & 0xFFFFFFFFu) - 1;
  if (slot < 0 || slot >= scene_->slot_count || body_in(int32_t(slot)) != body) {
    fail(TS_ERROR_HANDLE, "body %llu is not in this world, or was taken out", static_cast<unsigned long long>(body));
  }
  return static_cast<int32_t>(slot);
}

std::vector<float> World::place_rows(const Asset& asset, const Vector& place, const Quaternion& turn,
                                     const Vector& drift, const Vector& spin) const {
  const Matrix rows = matrix_of(turn);
  std::vector<float> found(asset.rest_rows.begin(), asset.rest_rows.end());
  std::vector<Vector> x(asset.vertex_count());
  double farthest = 0.0, highest = -std::numeric_limits<double>::infinity();
  for (size_t v = 0; v < x.size(); ++v) {
    const double* rest = asset.vertices.data + 3 * v;
    x[v] = turned({rest[0], rest[1], rest[2]}, rows);
    for (int k = 0; k < 3; ++k) {
      x[v][k] = x[v][k] + place[k];
      farthest = std::max(farthest, std::fabs(x[v][k]));
      found[8 * v + k] = as_float(x[v][k]);
      found[8 * v + 3 + k] = as_float(drift[k]);
    }
    highest = std::max(highest, x[v][2]);
  }
  if (!(farthest < scene_->position_limit)) {
    fail(TS_ERROR_ARGUMENT, "position puts the body beyond %g m: stay nearer the origin", scene_->position_limit);
  }
  double lowest = std::numeric_limits<double>::infinity();
  for (int32_t v : asset.outer) lowest = std::min(lowest, x[v][2]);
  if (scene_->has_floor && lowest < scene_->floor - 1e-3 * (highest - lowest)) {
    fail(TS_ERROR_ARGUMENT, "the body would begin %.4g m below the floor: raise it", scene_->floor - lowest);
  }
  if (spin[0] != 0.0 || spin[1] != 0.0 || spin[2] != 0.0) {
    Vector center = turned(asset.center, rows);
    for (int k = 0; k < 3; ++k) center[k] = center[k] + place[k];
    const double a = spin[0], b = spin[1], c = spin[2];
    const Matrix turning = {{{0, -c, b}, {c, 0, -a}, {-b, a, 0}}};
    double fastest = 0.0;
    for (size_t v = 0; v < x.size(); ++v) {
      const Vector arm = {x[v][0] - center[0], x[v][1] - center[1], x[v][2] - center[2]};
      const Vector more = turned(arm, turning);
      for (int k = 0; k < 3; ++k) {
        float& speed = found[8 * v + 3 + k];
        speed = as_float(double(speed) + more[k]);
        fastest = std::max(fastest, double(std::fabs(speed)));
      }
    }
    if (!(fastest < scene_->velocity_limit)) {
      fail(TS_ERROR_ARGUMENT, "spin makes a vertex %.4g m/s fast: stay below %g", fastest, scene_->velocity_limit);
    }
  }
  for (int32_t v : asset.pinned) found[8 * v + 3] = found[8 * v + 4] = found[8 * v + 5] = 0.0f;
  return found;
}

ts_body World::spawn(int32_t asset, const Vector& place, const Quaternion& turn, const Vector& drift,
                     const Vector& spin) {
  if (asset < 0 || size_t(asset) >= scene_->assets.size()) {
    fail(TS_ERROR_ARGUMENT, "asset is %d: there are %zu, from 0", asset, scene_->assets.size());
  }
  int32_t slot = 0;
  while (slot < scene_->slot_count && (scene_->asset_of_slot[slot] != asset || body_status_(slot) != kAbsent)) ++slot;
  if (slot == scene_->slot_count) {
    fail(TS_ERROR_STATE, "all %d bodies of asset %d live: reserve more before exporting, or despawn one",
         scene_->assets[asset].slot_count, asset);
  }
  const std::vector<float> rows = place_rows(scene_->assets[asset], place, turn, drift, spin);
  std::copy(rows.begin(), rows.end(), machine_->rows.room<float>(machine_->runtime(), rows.size()));
  machine_->launch("spawn_body", {Machine::whole(slot), Machine::array(machine_->rows.memory(), TI_DATA_TYPE_F32,
                                                                       uint32_t(rows.size() / 8), 8)});
  generations_[slot] = (generations_[slot] + 1) & 0xFFFFFF;
  is_still_ = false;
  rows_at_ = -1.0;
  return body_in(slot);
}

void World::despawn(int32_t slot) {
  if ((body_drives_(slot) & (kGrabbed | kJoined)) != 0 || is_driven_(slot) != 0) {
    fail(TS_ERROR_STATE, "the body in slot %d is grabbed, joined to another or driven: it cannot be taken out", slot);
  }
  wake_near(box_of(slot));
  is_still_ = false;
  body_drives_(slot) &= ~kMovesPins;  // or what hung from a frame would be aimed for ever
  machine_->launch("despawn_body", {Machine::whole(slot)});
}

void World::read_positions(int32_t slot, double alpha, float* rows) {
  if (!(alpha >= 0.0 && alpha <= 1.0)) fail(TS_ERROR_ARGUMENT, "alpha is %g: give a number from 0 to 1", alpha);
  const size_t n = asset_of(slot).vertex_count();
  if (alpha == 1.0) {
    for (size_t v = 0; v < n; ++v) {
      for (int k = 0; k < 3; ++k) rows[3 * v + k] = position_(particle(slot, v), k);
    }
  } else {
    const uint32_t count = uint32_t(scene_->particle_count);
    const float* all = machine_->positions.room<float>(machine_->runtime(), 3 * count);
    if (rows_at_ != alpha) {
      machine_->launch("read_positions", {Machine::real(alpha), Machine::array(machine_->positions.memory(),
                                                                               TI_DATA_TYPE_F32, count, 3)});
      rows_at_ = alpha;
    }
    std::copy(all + 3 * begin_of(slot), all + 3 * (begin_of(slot) + n), rows);
  }
  scene_->axes.rows_out(rows, n, true, rows);
}

void World::read_mesh(int32_t slot, int32_t number, float* positions, float* normals) {
  const Mesh& mesh = scene_->meshes[number];
  const uint32_t count = uint32_t(mesh.vertex_count);
  const TiRuntime runtime = machine_->runtime();
  const float* x = machine_->vertices.room<float>(runtime, 3 * count);
  const float* n = machine_->normals.room<float>(runtime, 3 * count);
  std::string kernel = mesh.is_skin ? "write_skin" : "write_render_mesh";
  if (!mesh.is_serial) kernel += "_shared";
  const TiArgument ints = Machine::array(machine_->ints_of(number), TI_DATA_TYPE_I32, uint32_t(mesh.ints.count));
  const TiArgument x_out = Machine::array(machine_->vertices.memory(), TI_DATA_TYPE_F32, 3 * count);
  const TiArgument n_out = Machine::array(machine_->normals.memory(), TI_DATA_TYPE_F32, 3 * count);
  if (mesh.is_skin) {
    const uint32_t vertices = uint32_t(asset_of(slot).vertex_count());
    machine_->rows.room<float>(runtime, 12 * vertices);
    machine_->launch(
        kernel.c_str(),
        {Machine::whole(slot), Machine::whole(int32_t(vertices)), Machine::real(picture_), ints,
         Machine::array(machine_->floats_of(number), TI_DATA_TYPE_F32, uint32_t(mesh.floats.count)),
         Machine::array(machine_->rows.memory(), TI_DATA_TYPE_F32, 12 * vertices), x_out, n_out});
  } else {
    machine_->launch(kernel.c_str(), {Machine::whole(slot), Machine::real(picture_), ints, x_out, n_out});
  }
  scene_->axes.rows_out(x, count, true, positions);
  if (normals != nullptr) scene_->axes.rows_out(n, count, false, normals);
}

Vector World::center_of(int32_t slot) const {
  const Asset& asset = asset_of(slot);
  Vector moment = {0.0, 0.0, 0.0};
  double mass = 0.0;
  for (size_t v = 0; v < asset.vertex_count(); ++v) {
    mass += asset.masses[v];
    for (int k = 0; k < 3; ++k) moment[k] += asset.masses[v] * position_(particle(slot, v), k);
  }
  for (double& each : moment) each /= mass;
  return moment;
}

std::vector<int32_t> World::checked(int32_t slot, Vertices which, bool may_be_all) const {
  const size_t n = asset_of(slot).vertex_count();
  std::vector<int32_t> found;
  if (which.count == 0) {
    if (!may_be_all) fail(TS_ERROR_ARGUMENT, "no vertex is named: name at least one, from 0 to %zu", n - 1);
    for (size_t v = 0; v < n; ++v) found.push_back(int32_t(v));
    return found;
  }
  found.assign(which.numbers, which.numbers + which.count);
  for (int32_t vertex : found) {
    if (vertex < 0 || size_t(vertex) >= n) fail(TS_ERROR_ARGUMENT, "there is no vertex %d: there are %zu", vertex, n);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

void World::give_rows(int32_t slot, const std::vector<int32_t>& vertices) {
  int32_t* rows = machine_->rows.room<int32_t>(machine_->runtime(), vertices.size());
  for (size_t i = 0; i < vertices.size(); ++i) rows[i] = int32_t(particle(slot, size_t(vertices[i])));
}

void World::require_unattached(int32_t slot, const std::vector<int32_t>& vertices) const {
  for (int32_t vertex : vertices) {
    if (particle_aim_(particle(slot, size_t(vertex))) >= kWithFrame) {
      fail(TS_ERROR_STATE, "vertex %d of the body in slot %d is attached to a frame", vertex, slot);
    }
  }
}

double World::mass_of(int32_t slot, const std::vector<int32_t>& vertices) const {
  double total = 0.0;
  for (int32_t vertex : vertices) total += asset_of(slot).masses[vertex];
  return total;
}

void World::set_velocity(int32_t slot, const Vector& linear, const Vector& spin) {
  float* motion = machine_->numbers.room<float>(machine_->runtime(), 6);
  for (int k = 0; k < 3; ++k) motion[k] = as_float(linear[k]), motion[3 + k] = as_float(spin[k]);
  const float* fastest = machine_->found.room<float>(machine_->runtime(), 1);
  machine_->launch("write_rigid_velocity",
                   {Machine::whole(slot), Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 6),
                    Machine::array(machine_->found.memory(), TI_DATA_TYPE_F32, 1)});
  if (!(*fastest < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "some vertices would be %.4g m/s fast: keep below %g", double(*fastest),
         scene_->velocity_limit);
  }
  rouse(slot);
}

void World::teleport(int32_t slot, const Vector& center, const Quaternion& turn, bool keeps_velocity) {
  require_unattached(slot, checked(slot, {nullptr, 0}, true));
  const Box left = box_of(slot);
  const double lowest = scene_->has_floor ? scene_->floor : -std::numeric_limits<double>::infinity();
  const Matrix rows = matrix_of(turn);
  double* place = machine_->numbers.room<double>(machine_->runtime(), 5);
  double* matrix = machine_->rows.room<double>(machine_->runtime(), 9);
  const double* found = machine_->found.room<double>(machine_->runtime(), 3);
  std::copy(center.begin(), center.end(), place);
  place[3] = lowest, place[4] = keeps_velocity ? 1.0 : 0.0;
  for (int i = 0; i < 9; ++i) matrix[i] = rows[i / 3][i % 3];
  machine_->launch("jump", {Machine::whole(slot), Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F64, 5),
                            Machine::array(machine_->rows.memory(), TI_DATA_TYPE_F64, 3, 3),
                            Machine::array(machine_->found.memory(), TI_DATA_TYPE_F64, 3)});
  if (!(found[2] < scene_->position_limit)) {
    fail(TS_ERROR_ARGUMENT, "center puts the body beyond %g m: stay nearer the origin", scene_->position_limit);
  }
  if (found[0] < lowest - 1e-3 * (found[1] - found[0])) {
    fail(TS_ERROR_ARGUMENT, "center puts the body %.4g m below the floor: raise it", lowest - found[0]);
  }
  rouse(slot);
  wake_near(left);
}

void World::apply_impulse(int32_t slot, const Vector& impulse, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, true);
  const double mass = mass_of(slot, vertices);
  const Vector change = {impulse[0] / mass, impulse[1] / mass, impulse[2] / mass};
  if (!(length_of(change) < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: keep below %g", length_of(change),
         scene_->velocity_limit);
  }
  give_rows(slot, vertices);
  float* numbers = machine_->numbers.room<float>(machine_->runtime(), 3);
  for (int k = 0; k < 3; ++k) numbers[k] = as_float(change[k]);
  machine_->launch("add_velocity",
                   {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, uint32_t(vertices.size())),
                    Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 3)});
  rouse(slot);
}

void World::apply_force(int32_t slot, const Vector& force, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, true);
  const double mass = mass_of(slot, vertices);
  float* numbers = machine_->numbers.room<float>(machine_->runtime(), 3);
  for (int k = 0; k < 3; ++k) {
    const double acceleration = force[k] / mass;
    if (!(std::fabs(acceleration) < scene_->push_limit)) {
      fail(TS_ERROR_ARGUMENT, "force would accelerate vertices by %.4g m/s^2: keep below %g", acceleration,
           scene_->push_limit);
    }
    numbers[k] = as_float(acceleration);
  }
  give_rows(slot, vertices);
  machine_->launch("add_push", {Machine::whole(slot),
                                Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, uint32_t(vertices.size())),
                                Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 3)});
  rouse(slot);
}

void World::impulse_at(int32_t slot, const Vector& impulse, const Vector& point, double radius) {
  if (!(radius >= 1e-9 && radius <= 1e9)) fail(TS_ERROR_ARGUMENT, "radius is %g m: give 1e-9 to 1e9", radius);
  float* place = machine_->numbers.room<float>(machine_->runtime(), 7);
  for (int k = 0; k < 3; ++k) place[k] = as_float(point[k]), place[4 + k] = as_float(impulse[k]);
  place[3] = as_float(radius);
  const double* found = machine_->found.room<double>(machine_->runtime(), 2);
  machine_->launch("add_impulse_near",
                   {Machine::whole(slot), Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 7),
                    Machine::array(machine_->found.memory(), TI_DATA_TYPE_F64, 2)});
  if (!(found[1] < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: keep below %g", found[1],
         scene_->velocity_limit);
  }
  if (found[0] >= radius) {
    fail(TS_ERROR_ARGUMENT, "point is %.4g m from the nearest vertex, beyond radius: aim at the body", found[0]);
  }
  rouse(slot);
}

void World::set_gravity_scale(int32_t slot, double scale) {
  if (!(std::fabs(scale) <= 1e3)) fail(TS_ERROR_ARGUMENT, "scale is %g: give -1000 to 1000", scale);
  gravity_scale_(slot) = as_float(scale);
  rouse(slot);
}

void World::set_damping(int32_t slot, double rate) {
  if (!(rate >= 0.0 && rate <= 1e6)) fail(TS_ERROR_ARGUMENT, "rate is %g: give 0 to 1e6 per second", rate);
  damping_(slot) = as_float(rate);
  body_drives_(slot) = (body_drives_(slot) & ~kDamped) | (as_float(rate) > 0.0f ? kDamped : 0);
  rouse(slot);
}

void World::set_sheltered(int32_t slot, bool is_sheltered) {
  body_drives_(slot) = (body_drives_(slot) & ~kSheltered) | (is_sheltered ? kSheltered : 0);
  rouse(slot);
}

void World::pin(int32_t slot, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  require_unattached(slot, vertices);
  give_rows(slot, vertices);
  machine_->launch("pin_particles",
                   {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, uint32_t(vertices.size()))});
  rouse(slot);
}

void World::unpin(int32_t slot, Vertices which) {
  std::vector<int32_t> vertices = checked(slot, which, true);
  if (which.count == 0) {
    const auto stays = [&](int32_t v) {
      const size_t p = particle(slot, size_t(v));
      return inv_mass_(p) != 0.0f || particle_aim_(p) >= kWithFrame;
    };
    vertices.erase(std::remove_if(vertices.begin(), vertices.end(), stays), vertices.end());
    if (vertices.empty()) return rouse(slot);
  } else {
    require_unattached(slot, vertices);
  }
  give_rows(slot, vertices);
  machine_->launch("free_particles",
                   {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, uint32_t(vertices.size()))});
  rouse(slot);
}

void World::set_targets(int32_t slot, Vertices which, const float* targets) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  if (vertices.size() != which.count) fail(TS_ERROR_ARGUMENT, "a vertex is named twice: name each once");
  std::vector<float> rows(3 * which.count);
  scene_->axes.rows_in(targets, which.count, rows.data());
  for (float each : rows) {
    if (!(std::fabs(each) < scene_->position_limit)) {
      fail(TS_ERROR_ARGUMENT, "a target is beyond %g m, or not finite", scene_->position_limit);
    }
  }
  require_unattached(slot, vertices);
  float* ordered = machine_->vertices.room<float>(machine_->runtime(), rows.size());
  for (size_t i = 0; i < which.count; ++i) {
    const size_t place =
        size_t(std::lower_bound(vertices.begin(), vertices.end(), which.numbers[i]) - vertices.begin());
    std::copy(rows.begin() + 3 * i, rows.begin() + 3 * i + 3, ordered + 3 * place);
  }
  give_rows(slot, vertices);
  const int32_t* loose = machine_->found.room<int32_t>(machine_->runtime(), 1);
  const uint32_t count = uint32_t(vertices.size());
  machine_->launch("write_targets", {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, count),
                                     Machine::array(machine_->vertices.memory(), TI_DATA_TYPE_F32, count, 3),
                                     Machine::array(machine_->found.memory(), TI_DATA_TYPE_I32, 1)});
  if (*loose >= 0) fail(TS_ERROR_STATE, "vertex %d is not pinned: call ts_body_pin first", vertices[size_t(*loose)]);
  rouse(slot);
  has_work_ = true;
}

// ---- all of them ----

void World::set_wind(const Vector& velocity, double density, double drag) {
  for (double each : velocity) {
    if (!(std::fabs(each) < scene_->velocity_limit)) fail(TS_ERROR_ARGUMENT, "velocity is %g m/s, too fast", each);
  }
  if (!(density >= 0.0 && density <= 1e5)) fail(TS_ERROR_ARGUMENT, "density is %g: give 0 to 100,000 kg/m^3", density);
  if (!(drag >= 0.0 && drag <= 1e3)) fail(TS_ERROR_ARGUMENT, "drag is %g: give 0 to 1,000", drag);
  const float given[4] = {as_float(velocity[0]), as_float(velocity[1]), as_float(velocity[2]),
                          as_float(density * drag)};
  bool differs = false;
  for (int k = 0; k < 4; ++k) differs = differs || given[k] != wind_(0, k);
  if (!differs) return;
  for (int k = 0; k < 4; ++k) wind_(0, k) = given[k];
  rouse(-1);
}

void World::radial_impulse(const Vector& center, double impulse, double radius) {
  if (!(radius >= 1e-9 && radius <= 1e9)) fail(TS_ERROR_ARGUMENT, "radius is %g m: give 1e-9 to 1e9", radius);
  if (!(std::fabs(impulse) <= scene_->impulse_limit)) fail(TS_ERROR_ARGUMENT, "impulse is %g N s, too much", impulse);
  float* place = machine_->numbers.room<float>(machine_->runtime(), 5);
  for (int k = 0; k < 3; ++k) place[k] = as_float(center[k]);
  place[3] = as_float(radius), place[4] = as_float(impulse);
  const float* highest = machine_->found.room<float>(machine_->runtime(), 1);
  machine_->launch("add_radial_impulse", {Machine::whole(scene_->slot_count),
                                          Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 5),
                                          Machine::array(machine_->found.memory(), TI_DATA_TYPE_F32, 1)});
  if (!(*highest < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: keep below %g", double(*highest),
         scene_->velocity_limit);
  }
  is_still_ = false;
  rows_at_ = -1.0;
  Box box;
  for (int k = 0; k < 3; ++k) box.lower[k] = center[k] - radius, box.upper[k] = center[k] + radius;
  wake_near(box);
}

// The slots of all who live, into a buffer. Returns how many.
uint32_t World::give_living() {
  int32_t* slots = machine_->rows.room<int32_t>(machine_->runtime(), size_t(scene_->slot_count));
  uint32_t count = 0;
  for (int32_t slot = 0; slot < scene_->slot_count; ++slot) {
    if (body_status_(slot) != kAbsent) slots[count++] = slot;
  }
  return count;
}

Hit World::hit_from(const float* row) const {
  Hit found;
  if (row[10] < 0.0f) return found;
  found.slot = int32_t(row[10]);
  found.triangle = int32_t(row[11]);
  found.distance = row[0];
  const Archive::View<int32_t>& surface = asset_of(found.slot).surface;
  for (int k = 0; k < 3; ++k) {
    // A body without triangles is asked vertex by vertex.
    found.vertices[k] = surface.count == 0 ? found.triangle : surface[size_t(3 * found.triangle + k)];
    found.weights[k] = row[1 + k];
    found.point[k] = row[4 + k];
    found.normal[k] = row[7 + k];
  }
  if (surface.count == 0) found.triangle = -1;
  return found;
}

namespace {

// The least number above: kernels take what is nearer, and the limit itself still counts.
float just_beyond(double limit) {
  return std::nextafter(as_float(std::min(limit, 3e38)), std::numeric_limits<float>::infinity());
}

}  // namespace

Hit World::first_hit(const Vector& origin, const Vector& direction, double farthest) {
  double largest = 0.0;
  for (double each : direction) largest = std::max(largest, std::fabs(each));
  if (largest == 0.0) fail(TS_ERROR_ARGUMENT, "direction has zero length");
  const Vector scaled = {direction[0] / largest, direction[1] / largest, direction[2] / largest};
  const double length = length_of(scaled);
  const uint32_t count = give_living();
  float* ray = machine_->numbers.room<float>(machine_->runtime(), 8);
  float* hit = machine_->found.room<float>(machine_->runtime(), 12);
  for (int k = 0; k < 3; ++k) ray[k] = as_float(origin[k]), ray[3 + k] = as_float(scaled[k] / length);
  ray[6] = just_beyond(farthest), ray[7] = 1.0f;
  std::fill(hit, hit + 12, -1.0f);
  if (count > 0) {
    machine_->launch("find_hits", {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, count),
                                   Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 1, 8),
                                   Machine::array(machine_->found.memory(), TI_DATA_TYPE_F32, 1, 12)});
  }
  return hit_from(hit);
}

Hit World::closest(const Vector& point, double farthest) {
  const uint32_t count = give_living();
  float* asked = machine_->numbers.room<float>(machine_->runtime(), 4);
  float* hit = machine_->found.room<float>(machine_->runtime(), 13);
  for (int k = 0; k < 3; ++k) asked[k] = as_float(point[k]);
  asked[3] = just_beyond(farthest * farthest);
  std::fill(hit, hit + 13, -1.0f);
  if (count > 0) {
    machine_->launch("find_closest", {Machine::array(machine_->rows.memory(), TI_DATA_TYPE_I32, count),
                                      Machine::array(machine_->numbers.memory(), TI_DATA_TYPE_F32, 4),
                                      Machine::array(machine_->found.memory(), TI_DATA_TYPE_F32, 1, 13)});
  }
  Hit nearest = hit_from(hit);
  nearest.is_inside = hit[12] != 0.0f;
  return nearest;
}

// ---- colliders and frames ----

Collider& World::collider(int32_t number) {
  if (number < 0 || size_t(number) >= colliders_.rows.size() || !colliders_.rows[size_t(number)].is_alive) {
    fail(TS_ERROR_ARGUMENT, "there is no collider %d: there are %zu, from 0", number, colliders_.rows.size());
  }
  return colliders_.rows[size_t(number)];
}

int32_t World::add_collider(const Collider& row) {
  if (!scene_->has_contact) {
    fail(TS_ERROR_STATE, "this world was made without contact: give it collider_room before exporting");
  }
  const int32_t number = colliders_.free_row();
  if (size_t(number) >= collider_room_) {
    fail(TS_ERROR_STATE, "there is room for %zu colliders and all are in use: export with a larger collider_room",
         collider_room_);
  }
  if (size_t(number) == colliders_.rows.size()) colliders_.rows.push_back(row);
  colliders_.rows[size_t(number)] = row;
  write_colliders();
  double speed;
  wake_near(row.way(0.0, &speed));
  return number;
}

void World::remove_collider(int32_t number) {
  Collider& row = collider(number);
  row.is_alive = false;
  write_colliders();
  double speed;
  wake_near(row.way(0.0, &speed));
}

void World::write_colliders() {
  collider_count_(0) = int32_t(colliders_.rows.size());
  for (size_t c = 0; c < colliders_.rows.size(); ++c) {
    const Collider& row = colliders_.rows[c];
    collider_kind_(c) = row.is_alive ? row.kind : -1;
    for (int k = 0; k < 8; ++k) collider_parameters_(c, k) = row.parameters[k];
    collider_surface_(c, 0) = as_float(row.friction);
    collider_surface_(c, 1) = as_float(row.restitution);
    collider_surface_(c, 2) = as_float(row.skin);
    collider_filter_(c, 0) = row.group;
    collider_filter_(c, 1) = row.mask;
  }
  colliders_.is_dirty = true;
}

void World::move_collider(int32_t number, const Pose& pose) {
  Collider& row = collider(number);
  row.target = pose;
  row.has_target = true;
  colliders_.is_dirty = true;
}

void World::set_collider_velocity(int32_t number, const Vector& linear, const Vector& spin) {
  Collider& row = collider(number);
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(linear[k]) < scene_->velocity_limit) || !(std::fabs(spin[k]) < scene_->spin_limit)) {
      fail(TS_ERROR_ARGUMENT, "a velocity of %g m/s or %g rad/s is too fast", linear[k], spin[k]);
    }
  }
  row.velocity = linear, row.spin = spin, row.has_target = false;
  colliders_.is_dirty = true;
}

void World::teleport_collider(int32_t number, const Pose& pose) {
  Collider& row = collider(number);
  double speed;
  wake_near(row.way(0.0, &speed));
  row.pose = pose;
  row.has_target = false;
  colliders_.is_dirty = true;
  wake_near(row.way(0.0, &speed));
}

void World::collider_impulse(int32_t number, Vector* impulse, Vector* moment) {
  collider(number);
  const uint32_t count = uint32_t(colliders_.rows.size());
  const float* rows = machine_->rows.room<float>(machine_->runtime(), 6 * count);
  machine_->launch("sum_collider_impulses",
                   {Machine::whole(scene_->slot_count),
                    Machine::array(machine_->rows.memory(), TI_DATA_TYPE_F32, count, 6)});
  for (int k = 0; k < 3; ++k) (*impulse)[k] = rows[6 * number + k], (*moment)[k] = rows[6 * number + 3 + k];
}

void World::move_frame(int32_t number, const Pose& pose) {
  const auto alive = scene_->archive.get<int32_t>("frames/alive");
  if (number < 0 || size_t(number) >= alive.count || alive[size_t(number)] == 0) {
    fail(TS_ERROR_ARGUMENT, "there is no frame %d: there are %zu, from 0", number, scene_->names(TS_FRAME).size());
  }
  const Matrix turn = matrix_of(pose.rotation);
  float* row = frames_.data() + 12 * size_t(number);
  for (int i = 0; i < 9; ++i) row[i] = as_float(turn[i / 3][i % 3]);
  for (int k = 0; k < 3; ++k) row[9 + k] = as_float(pose.position[k]);
}

// ---- states ----

uint64_t World::hash() const {
  // As `hash_bodies` in taichi_soft/persistence/kernels/packing.py.
  uint64_t code = 1469598103934665603u;
  const auto mix = [&code](uint64_t word) {
    code = (code ^ word) * 1099511628211u;
    code ^= code >> 29;
  };
  const auto mix_two = [&mix](uint32_t x, uint32_t y) { mix(uint64_t(x) | uint64_t(y) << 32); };
  for (int32_t body = 0; body < scene_->slot_count; ++body) {
    mix(uint32_t(body_status_(body)));
    if (body_status_(body) == kAbsent) continue;
    mix_two(bits_of(lag_(body)), uint32_t(body_drives_(body)));
    mix_two(bits_of(gravity_scale_(body)), bits_of(damping_(body)));
    const size_t begin = begin_of(body), end = begin + asset_of(body).vertex_count();
    for (size_t p = begin; p < end; ++p) {
      for (int k = 0; k < 3; ++k) mix_two(bits_of(position_(p, k)), bits_of(velocity_(p, k)));
      mix_two(bits_of(inv_mass_(p)), uint32_t(particle_aim_(p)));
    }
  }
  return code;
}

namespace {

constexpr uint64_t kSnapshotMark = 0x3150414E53534354u;

struct SnapshotHead {
  uint64_t mark, size;
  uint32_t scene, sum;
  int64_t steps;
  uint64_t colliders;
  double time, last_dt;
};

template <typename Part>
void put(char** at, const Part* data, size_t count) {
  std::memcpy(*at, data, count * sizeof(Part));
  *at += count * sizeof(Part);
}

template <typename Part>
void take(const char** at, Part* data, size_t count) {
  std::memcpy(data, *at, count * sizeof(Part));
  *at += count * sizeof(Part);
}

}  // namespace

size_t World::snapshot_size() const {
  return sizeof(SnapshotHead) + 4 * scene_->carried_words + sizeof(float) * frames_.size() +
         sizeof(uint32_t) * generations_.size() + sizeof(Collider) * colliders_.rows.size();
}

void World::snapshot(char* bytes) const {
  SnapshotHead head{};
  head.mark = kSnapshotMark, head.size = snapshot_size(), head.scene = scene_->code;
  head.colliders = colliders_.rows.size();
  head.steps = steps_, head.time = time_, head.last_dt = last_dt_;
  char* at = bytes + sizeof head;
  for (const Carried& each : scene_->carried) {
    const char* row = machine_->root() + each.place.offset;
    for (size_t i = 0; i < each.count; ++i, row += each.place.stride) put(&at, row, 4 * each.place.width);
  }
  put(&at, frames_.data(), frames_.size());
  put(&at, generations_.data(), generations_.size());
  for (const Collider& each : colliders_.rows) {
    Collider row;
    std::memset(static_cast<void*>(&row), 0, sizeof row);  // what lies between its parts is the same every time
    row = each;
    put(&at, &row, 1);
  }
  std::memcpy(bytes, &head, sizeof head);
  head.sum = checksum(bytes, head.size);  // with a sum of 0 in its place
  std::memcpy(bytes, &head, sizeof head);
}

// Fails where a step would read beyond its fields, or begin with what is not finite.
void World::require_rows(const char* at, size_t colliders) const {
  const auto refuse = [] { fail(TS_ERROR_SNAPSHOT, "this snapshot is not in order: it names what there is not"); };
  const Scene& s = *scene_;
  const size_t status = s.place("body_status").offset, aim = s.place("particle_aim").offset;
  const int64_t aims = kWithFrame + int64_t(frames_.size() / 12);
  for (const Carried& each : s.carried) {
    for (size_t i = 0; i < each.count * each.place.width; ++i) {
      if (each.place.is_whole) {
        int32_t number;
        take(&at, &number, 1);
        if (each.place.offset == status && (number < 0 || number > kAbsent)) refuse();
        if (each.place.offset == aim && (number < 0 || number >= aims)) refuse();
        if (each.is_fixed) {
          const size_t row = i / each.place.width, column = i % each.place.width;
          const char* now = machine_->root() + each.place.offset + row * each.place.stride + 4 * column;
          if (std::memcmp(now, &number, 4) != 0) refuse();
        }
      } else {
        float number;
        take(&at, &number, 1);
        if (each.is_finite && !std::isfinite(number)) refuse();
      }
    }
  }
  for (size_t i = 0; i < frames_.size(); ++i) {
    float number;
    take(&at, &number, 1);
    if (!(std::fabs(number) <= s.position_limit)) refuse();
  }
  at += sizeof(uint32_t) * generations_.size();
  for (size_t i = 0; i < colliders; ++i) {
    unsigned char flags[2];
    std::memcpy(flags, at + offsetof(Collider, is_alive), 1);
    std::memcpy(flags + 1, at + offsetof(Collider, has_target), 1);
    if (flags[0] > 1 || flags[1] > 1) refuse();
    Collider row;
    take(&at, &row, 1);
    // Those with a grid were there when the world was exported.
    const bool is_known = row.kind >= 0 && (row.kind <= 3 || (i < s.names(TS_COLLIDER).size() && row.kind <= 5));
    if (!is_known || !(length_of(row.pose.position) <= 1e9) || !(std::fabs(length_of(row.pose.rotation) - 1.0) <= 1e-3)) {
      refuse();
    }
  }
}

void World::restore(const char* bytes, size_t size) {
  SnapshotHead head;
  if (size < sizeof head) fail(TS_ERROR_SNAPSHOT, "%zu bytes are no snapshot", size);
  std::memcpy(&head, bytes, sizeof head);
  if (head.mark != kSnapshotMark) fail(TS_ERROR_SNAPSHOT, "these bytes are no snapshot");
  if (head.scene != scene_->code) fail(TS_ERROR_SNAPSHOT, "this snapshot is of another world file");
  const size_t others = snapshot_size() - sizeof(Collider) * colliders_.rows.size();
  if (head.size != size || size != others + sizeof(Collider) * head.colliders || head.colliders > collider_room_) {
    fail(TS_ERROR_SNAPSHOT, "this snapshot is cut off");
  }
  std::vector<char> whole(bytes, bytes + size);
  const uint32_t sum = head.sum;
  head.sum = 0;
  std::memcpy(whole.data(), &head, sizeof head);
  if (sum != checksum(whole.data(), size)) {
    fail(TS_ERROR_SNAPSHOT, "this snapshot is damaged: its checksum is wrong");
  }
  require_rows(bytes + sizeof head, head.colliders);
  const char* at = bytes + sizeof head;
  for (const Carried& each : scene_->carried) {
    char* row = machine_->root() + each.place.offset;
    for (size_t i = 0; i < each.count; ++i, row += each.place.stride) take(&at, row, 4 * each.place.width);
  }
  take(&at, frames_.data(), frames_.size());
  take(&at, generations_.data(), generations_.size());
  colliders_.rows.resize(size_t(head.colliders));
  take(&at, colliders_.rows.data(), colliders_.rows.size());
  if (scene_->has_contact) write_colliders();
  steps_ = head.steps, time_ = head.time, last_dt_ = head.last_dt;
  colliders_.is_dirty = has_work_ = true;
  is_still_ = false;
  rows_at_ = -1.0;
}

}  // namespace taichi_soft
