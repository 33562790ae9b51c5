#include <algorithm>
#include <limits>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

constexpr ts_body kBody = uint64_t(3) << 56;  // prefix of body handles

}  // namespace

ts_body World::body_in(int32_t slot) const {
  if (slot < 0 || slot >= scene_->slot_count) {
    fail(TS_ERROR_ARGUMENT, "slot %d does not exist (%d in all, numbered from 0)", slot, scene_->slot_count);
  }
  return fields_.body_status(slot) == kAbsent ? 0 : kBody | ts_body(generations_[slot]) << 32 | uint32_t(slot + 1);
}

int32_t World::slot_of(ts_body body) const {
  const int64_t slot = int64_t(body & 0xFFFFFFFFu) - 1;
  if (slot < 0 || slot >= scene_->slot_count || body_in(int32_t(slot)) != body) {
    fail(TS_ERROR_HANDLE, "body %llu is not in this world, or was removed", static_cast<unsigned long long>(body));
  }
  return static_cast<int32_t>(slot);
}

// Positions of a body's contact points if its vertices are at `x`.
std::vector<Vector> World::touching_points(const Asset& asset, const std::vector<Vector>& x) const {
  std::vector<Vector> found;
  if (asset.hull.count == 0) {
    for (int32_t v : asset.outer) found.push_back(x[size_t(v)]);
  }
  for (size_t h = 0; h < asset.hull.count; h += 4) {
    Vector point = {0.0, 0.0, 0.0};
    for (size_t i = h; i < h + 4; ++i) {
      for (size_t k = 0; k < 3; ++k) point[k] += asset.hull_weights[i] * x[size_t(asset.hull[i])][k];
    }
    found.push_back(point);
  }
  return found;
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
      float* row = found.data() + kRestWidth * v;
      row[k] = as_float(x[v][k]);
      row[3 + k] = as_float(drift[k]);
      row[8 + k] = as_float(x[v][k] - double(row[k]));
    }
    highest = std::max(highest, x[v][2]);
  }
  if (!(farthest < scene_->position_limit)) {
    fail(TS_ERROR_ARGUMENT, "position puts the body beyond %g m: move it closer to the origin", scene_->position_limit);
  }
  double lowest = std::numeric_limits<double>::infinity();
  for (const Vector& each : touching_points(asset, x)) lowest = std::min(lowest, each[2]);
  if (scene_->has_floor && lowest < surroundings_.floor - 1e-3 * (highest - lowest)) {
    fail(TS_ERROR_ARGUMENT, "position starts the body %.4g m below the floor: raise it", surroundings_.floor - lowest);
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
        float& speed = found[kRestWidth * v + 3 + k];
        speed = as_float(double(speed) + more[k]);
        fastest = std::max(fastest, double(std::fabs(speed)));
      }
    }
    if (!(fastest < scene_->velocity_limit)) {
      fail(TS_ERROR_ARGUMENT, "spin moves a vertex at %.4g m/s: stay below %g", fastest, scene_->velocity_limit);
    }
  }
  for (int32_t v : asset.pinned) std::fill_n(found.begin() + std::ptrdiff_t(kRestWidth * size_t(v) + 3), 3, 0.0f);
  return found;
}

ts_body World::spawn(int32_t asset, const Vector& place, const Quaternion& turn, const Vector& drift,
                     const Vector& spin) {
  if (asset < 0 || size_t(asset) >= scene_->assets.size()) {
    fail(TS_ERROR_ARGUMENT, "asset %d does not exist (%zu in all, numbered from 0)", asset, scene_->assets.size());
  }
  int32_t slot = 0;
  while (slot < scene_->slot_count && (scene_->asset_of_slot[slot] != asset || fields_.body_status(slot) != kAbsent))
    ++slot;
  if (slot == scene_->slot_count) {
    fail(TS_ERROR_STATE, "all %d bodies of asset %d are in use: reserve more before exporting, or despawn one",
         scene_->assets[asset].slot_count, asset);
  }
  const std::vector<float> rows = place_rows(scene_->assets[asset], place, turn, drift, spin);
  if (levels_[size_t(slot)] != 0) {
    refill(slot, 0);
  } else if (scene_->assets[size_t(asset)].level_count() > 1) {
    write_kind(slot);  // a snapshot may have restored data of another body into the slot
  }
  std::copy(rows.begin(), rows.end(), machine_->rows.room<float>(rows.size()));
  const Asset& kind = scene_->assets[size_t(asset)];
  machine_->launch("spawn_body", {Machine::whole(slot),
                                  Machine::array(machine_->rows, uint32_t(rows.size() / kRestWidth), kRestWidth),
                                  Machine::whole(kind.group), Machine::whole(kind.mask)});
  generations_[slot] = (generations_[slot] + 1) & 0xFFFFFF;
  is_still_ = false;
  rows_at_ = -1.0;
  return body_in(slot);
}

void World::despawn(int32_t slot) {
  for (size_t j = 0; j < kMostJoints; ++j) {
    if (fields_.joints.bodies(j, 0) == slot + 1 || fields_.joints.bodies(j, 1) == slot + 1) end_joint(j);
  }
  for (size_t m = 0; m < kMostMotors; ++m) {
    if (fields_.motors.motor.body(m) == slot + 1) end_motor(m);
  }
  for (size_t g = 0; g < kMostGrabs; ++g) {
    if (fields_.grabs.body(g) == slot + 1) end_grab(g);
  }
  give_friction(slot, asset_of(slot).friction);
  wake_near(box_of(slot));
  is_still_ = false;
  std::fill_n(feels_.begin() + std::ptrdiff_t(begin_of(slot)), asset_of(slot).vertex_count(), 0);
  std::fill_n(attachments_.begin() + std::ptrdiff_t(begin_of(slot)), asset_of(slot).vertex_count(), 0);
  std::fill_n(break_forces_.begin() + std::ptrdiff_t(begin_of(slot)), asset_of(slot).vertex_count(), 0.0f);
  fields_.body_drives(slot) &= ~kMovesPins;  // attached vertices no longer move to earlier targets
  machine_->launch("despawn_body", {Machine::whole(slot)});
}

void World::set_enabled(int32_t slot, bool is_enabled) {
  if (is_enabled == (fields_.body_status(slot) < kAbsent)) return;
  for (size_t j = 0; j < kMostJoints; ++j) {
    const int32_t a = fields_.joints.bodies(j, 0) - 1, b = fields_.joints.bodies(j, 1) - 1;
    if (a == slot || b == slot) wake_slot(a == slot ? b : a);
  }
  wake_near(box_of(slot));
  machine_->launch(is_enabled ? "enable_body" : "disable_body", {Machine::whole(slot)});
  if (!is_enabled) {
    end_forbidden_contacts();
  } else if (scene_->has_soft_contact) {
    machine_->launch("mark_placed", {Machine::whole(slot)});  // other bodies can have moved into it
  }
  has_work_ = has_work_ || is_enabled;
  joints_have_changed();
  is_still_ = false;
  rows_at_ = -1.0;
}

void World::read_positions(int32_t slot, double alpha, float* rows) {
  if (!(alpha >= 0.0 && alpha <= 1.0)) fail(TS_ERROR_ARGUMENT, "alpha is %g: give a number from 0 to 1", alpha);
  const size_t n = asset_of(slot).vertex_count();
  if (alpha == 1.0 && !has_view()) {
    for (size_t v = 0; v < n; ++v) {
      for (int k = 0; k < 3; ++k) rows[3 * v + k] = fields_.particle_position(particle(slot, v), k);
    }
  } else {
    const uint32_t count = uint32_t(scene_->particle_count);
    const float* all = machine_->positions.room<float>(3 * count);
    if (rows_at_ != alpha) {
      machine_->launch("read_positions", {Machine::real(alpha), Machine::whole(has_view() ? 1 : 0),
                                          Machine::array(machine_->positions, count, 3)});
      rows_at_ = alpha;
    }
    std::copy(all + 3 * begin_of(slot), all + 3 * (begin_of(slot) + n), rows);
  }
  scene_->axes.rows_out(rows, n, true, rows);
}

void World::read_mesh(int32_t slot, int32_t number, float* positions, float* normals) {
  const Mesh& mesh = scene_->meshes[number];
  const uint32_t count = uint32_t(mesh.vertex_count);
  const float* x = machine_->vertices.room<float>(3 * count);
  const float* n = machine_->normals.room<float>(3 * count);
  const Mesh::Table& table = mesh.table(level_of(slot));
  std::string kernel = mesh.is_skin ? "write_skin" : "write_render_mesh";
  if (!table.is_serial) kernel += "_shared";
  const Argument ints = Machine::array(table.ints.data, uint32_t(table.ints.count));
  const Argument x_out = Machine::array(machine_->vertices, 3 * count);
  const Argument n_out = Machine::array(machine_->normals, 3 * count);
  if (mesh.is_skin) {
    const uint32_t vertices = uint32_t(asset_of(slot).vertex_count());
    machine_->rows.room<float>(12 * vertices);
    machine_->launch(kernel.c_str(), {Machine::whole(slot), Machine::whole(int32_t(vertices)), Machine::real(picture_),
                                      ints, Machine::array(table.floats.data, uint32_t(table.floats.count)),
                                      Machine::array(machine_->rows, 12 * vertices), x_out, n_out});
  } else {
    machine_->launch(kernel.c_str(), {Machine::whole(slot), Machine::real(picture_), ints, x_out, n_out});
  }
  scene_->axes.rows_out(x, count, true, positions);
  if (normals != nullptr) scene_->axes.rows_out(n, count, false, normals);
}

// The following functions have the same results as those in taichi_soft/bodies/kernels/origins.py.

bool World::has_origin(int32_t slot) const {
  bool found = false;
  for (size_t k = 0; k < 3; ++k) found = found || fields_.body_origin(size_t(slot), k) != 0.0f;
  return found;
}

// Position of a particle relative to the origin of its body.
std::array<float, 3> World::local_position(int32_t slot, size_t p) const {
  std::array<float, 3> rounded, local;
  bool is_current = true;
  for (size_t k = 0; k < 3; ++k) {
    const float origin = fields_.body_origin(size_t(slot), k), x = fields_.particle_position(p, k);
    local[k] = fields_.particle_local(p, k);
    rounded[k] = x - origin;
    is_current = is_current && local[k] + origin == x;
  }
  return is_current ? local : rounded;
}

Vector World::exact_position(int32_t slot, size_t vertex) const {
  const size_t p = particle(slot, vertex);
  Vector found = vertex_place(slot, int32_t(vertex));
  if (has_origin(slot)) {
    const std::array<float, 3> local = local_position(slot, p);
    for (size_t k = 0; k < 3; ++k) found[k] = double(fields_.body_origin(size_t(slot), k)) + double(local[k]);
  }
  return found;
}

Vector World::center_of(int32_t slot) const {
  const Asset& asset = asset_of(slot);
  Vector moment = {0.0, 0.0, 0.0};
  double mass = 0.0;
  for (size_t v = 0; v < asset.vertex_count(); ++v) {
    mass += asset.masses[v];
    const Vector x = exact_position(slot, v);
    for (int k = 0; k < 3; ++k) moment[k] += asset.masses[v] * x[k];
  }
  for (double& each : moment) each /= mass;
  return moment;
}

std::vector<int32_t> World::checked(int32_t slot, Vertices which, bool may_be_all) const {
  const size_t n = asset_of(slot).vertex_count();
  std::vector<int32_t> found;
  if (which.count == 0) {
    if (!may_be_all) fail(TS_ERROR_ARGUMENT, "the list of vertices is empty: give at least one, from 0 to %zu", n - 1);
    for (size_t v = 0; v < n; ++v) found.push_back(int32_t(v));
    return found;
  }
  found.assign(which.numbers, which.numbers + which.count);
  for (int32_t vertex : found) {
    if (vertex < 0 || size_t(vertex) >= n)
      fail(TS_ERROR_ARGUMENT, "vertex %d does not exist (%zu in all, numbered from 0)", vertex, n);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

void World::give_rows(int32_t slot, const std::vector<int32_t>& vertices) {
  int32_t* rows = machine_->rows.room<int32_t>(vertices.size());
  for (size_t i = 0; i < vertices.size(); ++i) rows[i] = int32_t(particle(slot, size_t(vertices[i])));
}

void World::require_unattached(int32_t slot, const std::vector<int32_t>& vertices) const {
  for (int32_t vertex : vertices) {
    if (fields_.particle_aim(particle(slot, size_t(vertex))) >= kWithFrame) {
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
  float* motion = machine_->numbers.room<float>(6);
  for (int k = 0; k < 3; ++k) motion[k] = as_float(linear[k]), motion[3 + k] = as_float(spin[k]);
  const float* fastest = machine_->found.room<float>(1);
  machine_->launch("write_rigid_velocity",
                   {Machine::whole(slot), Machine::array(machine_->numbers, 6), Machine::array(machine_->found, 1)});
  if (!(*fastest < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "some vertices would reach %.4g m/s: stay below %g", double(*fastest),
         scene_->velocity_limit);
  }
  mark_modified(slot);
}

void World::teleport(int32_t slot, const Vector& center, const Quaternion& turn, bool keeps_velocity) {
  require_unattached(slot, checked(slot, {nullptr, 0}, true));
  const Box left = box_of(slot);
  const double lowest = scene_->has_floor ? surroundings_.floor : -std::numeric_limits<double>::infinity();
  const Matrix rows = matrix_of(turn);
  double* place = machine_->numbers.room<double>(5);
  double* matrix = machine_->rows.room<double>(9);
  const double* found = machine_->found.room<double>(3);
  std::copy(center.begin(), center.end(), place);
  place[3] = lowest, place[4] = keeps_velocity ? 1.0 : 0.0;
  for (int i = 0; i < 9; ++i) matrix[i] = rows[i / 3][i % 3];
  machine_->launch("jump", {Machine::whole(slot), Machine::array(machine_->numbers, 5),
                            Machine::array(machine_->rows, 3, 3), Machine::array(machine_->found, 3)});
  if (!(found[2] < scene_->position_limit)) {
    fail(TS_ERROR_ARGUMENT, "center puts the body beyond %g m: move it closer to the origin", scene_->position_limit);
  }
  if (found[0] < lowest - 1e-3 * (found[1] - found[0])) {
    fail(TS_ERROR_ARGUMENT, "center puts the body %.4g m below the floor: raise it", lowest - found[0]);
  }
  mark_modified(slot);
  wake_near(left);
}

void World::apply_impulse(int32_t slot, const Vector& impulse, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, true);
  const double mass = mass_of(slot, vertices);
  const Vector change = {impulse[0] / mass, impulse[1] / mass, impulse[2] / mass};
  if (!(length_of(change) < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: stay below %g", length_of(change),
         scene_->velocity_limit);
  }
  give_rows(slot, vertices);
  float* numbers = machine_->numbers.room<float>(3);
  for (int k = 0; k < 3; ++k) numbers[k] = as_float(change[k]);
  machine_->launch("add_velocity",
                   {Machine::array(machine_->rows, uint32_t(vertices.size())), Machine::array(machine_->numbers, 3)});
  mark_modified(slot);
}

void World::apply_force(int32_t slot, const Vector& force, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, true);
  const double mass = mass_of(slot, vertices);
  float* numbers = machine_->numbers.room<float>(3);
  for (int k = 0; k < 3; ++k) {
    const double acceleration = force[k] / mass;
    if (!(std::fabs(acceleration) < scene_->push_limit)) {
      fail(TS_ERROR_ARGUMENT, "force would accelerate vertices by %.4g m/s^2: stay below %g", acceleration,
           scene_->push_limit);
    }
    numbers[k] = as_float(acceleration);
  }
  give_rows(slot, vertices);
  machine_->launch("add_push", {Machine::whole(slot), Machine::array(machine_->rows, uint32_t(vertices.size())),
                                Machine::array(machine_->numbers, 3)});
  mark_modified(slot);
}

void World::impulse_at(int32_t slot, const Vector& impulse, const Vector& point, double radius) {
  if (!(radius >= 1e-9 && radius <= 1e9)) fail(TS_ERROR_ARGUMENT, "radius is %g m: give 1e-9 to 1e9", radius);
  float* place = machine_->numbers.room<float>(7);
  for (int k = 0; k < 3; ++k) place[k] = as_float(point[k]), place[4 + k] = as_float(impulse[k]);
  place[3] = as_float(radius);
  const double* found = machine_->found.room<double>(2);
  machine_->launch("add_impulse_near",
                   {Machine::whole(slot), Machine::array(machine_->numbers, 7), Machine::array(machine_->found, 2)});
  if (!(found[1] < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: stay below %g", found[1],
         scene_->velocity_limit);
  }
  if (found[0] >= radius) {
    fail(TS_ERROR_ARGUMENT, "point is %.4g m from the nearest vertex, beyond radius: aim at the body", found[0]);
  }
  mark_modified(slot);
}

void World::set_gravity_scale(int32_t slot, double scale) {
  if (!(std::fabs(scale) <= 1e3)) fail(TS_ERROR_ARGUMENT, "scale is %g: give -1000 to 1000", scale);
  fields_.body_gravity_scale(slot) = as_float(scale);
  mark_modified(slot);
}

void World::set_damping(int32_t slot, double rate) {
  if (!(rate >= 0.0 && rate <= 1e6)) fail(TS_ERROR_ARGUMENT, "rate is %g: give 0 to 1e6 per second", rate);
  fields_.body_damping(slot) = as_float(rate);
  fields_.body_drives(slot) = (fields_.body_drives(slot) & ~kDamped) | (as_float(rate) > 0.0f ? kDamped : 0);
  mark_modified(slot);
}

void World::set_sheltered(int32_t slot, bool is_sheltered) {
  fields_.body_drives(slot) = (fields_.body_drives(slot) & ~kSheltered) | (is_sheltered ? kSheltered : 0);
  mark_modified(slot);
}

void World::pin(int32_t slot, Vertices which) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  require_unattached(slot, vertices);
  give_rows(slot, vertices);
  machine_->launch("pin_particles", {Machine::array(machine_->rows, uint32_t(vertices.size()))});
  mark_modified(slot);
}

void World::unpin(int32_t slot, Vertices which) {
  std::vector<int32_t> vertices = checked(slot, which, true);
  if (which.count == 0) {
    const auto stays = [&](int32_t v) {
      const size_t p = particle(slot, size_t(v));
      return fields_.particle_inv_mass(p) != 0.0f || fields_.particle_aim(p) >= kWithFrame;
    };
    vertices.erase(std::remove_if(vertices.begin(), vertices.end(), stays), vertices.end());
    if (vertices.empty()) return mark_modified(slot);
  } else {
    require_unattached(slot, vertices);
  }
  give_rows(slot, vertices);
  machine_->launch("free_particles", {Machine::array(machine_->rows, uint32_t(vertices.size()))});
  mark_modified(slot);
}

void World::set_targets(int32_t slot, Vertices which, const float* targets) {
  const std::vector<int32_t> vertices = checked(slot, which, false);
  if (vertices.size() != which.count) fail(TS_ERROR_ARGUMENT, "a vertex is given twice: give each one once");
  std::vector<float> rows(3 * which.count);
  scene_->axes.rows_in(targets, which.count, rows.data());
  for (float each : rows) {
    if (!(std::fabs(each) < scene_->position_limit)) {
      fail(TS_ERROR_ARGUMENT, "a target is beyond %g m, or not finite", scene_->position_limit);
    }
  }
  require_unattached(slot, vertices);
  double* ordered = machine_->vertices.room<double>(rows.size());
  for (size_t i = 0; i < which.count; ++i) {
    const size_t place =
        size_t(std::lower_bound(vertices.begin(), vertices.end(), which.numbers[i]) - vertices.begin());
    std::copy(rows.begin() + 3 * i, rows.begin() + 3 * i + 3, ordered + 3 * place);
  }
  give_rows(slot, vertices);
  const int32_t* loose = machine_->found.room<int32_t>(1);
  const uint32_t count = uint32_t(vertices.size());
  machine_->launch("write_targets", {Machine::array(machine_->rows, count),
                                     Machine::array(machine_->vertices, count, 3), Machine::array(machine_->found, 1)});
  if (*loose >= 0) fail(TS_ERROR_STATE, "vertex %d is not pinned: call ts_body_pin first", vertices[size_t(*loose)]);
  mark_modified(slot);
  has_work_ = true;
}

// ---- all bodies ----

void World::set_wind(const Vector& velocity, double density, double drag) {
  for (double each : velocity) {
    if (!(std::fabs(each) < scene_->velocity_limit)) fail(TS_ERROR_ARGUMENT, "velocity is %g m/s, too fast", each);
  }
  if (!(density >= 0.0 && density <= 1e5)) fail(TS_ERROR_ARGUMENT, "density is %g: give 0 to 100,000 kg/m^3", density);
  if (!(drag >= 0.0 && drag <= 1e3)) fail(TS_ERROR_ARGUMENT, "drag is %g: give 0 to 1,000", drag);
  const float given[4] = {as_float(velocity[0]), as_float(velocity[1]), as_float(velocity[2]),
                          as_float(density * drag)};
  bool differs = false;
  for (int k = 0; k < 4; ++k) differs = differs || given[k] != fields_.wind(0, k);
  if (!differs) return;
  for (int k = 0; k < 4; ++k) fields_.wind(0, k) = given[k];
  mark_modified(-1);
}

void World::radial_impulse(const Vector& center, double impulse, double radius) {
  if (!(radius >= 1e-9 && radius <= 1e9)) fail(TS_ERROR_ARGUMENT, "radius is %g m: give 1e-9 to 1e9", radius);
  if (!(std::fabs(impulse) <= scene_->impulse_limit)) fail(TS_ERROR_ARGUMENT, "impulse is %g N s, too much", impulse);
  float* place = machine_->numbers.room<float>(5);
  for (int k = 0; k < 3; ++k) place[k] = as_float(center[k]);
  place[3] = as_float(radius), place[4] = as_float(impulse);
  const float* highest = machine_->found.room<float>(1);
  machine_->launch("add_radial_impulse", {Machine::whole(scene_->slot_count), Machine::array(machine_->numbers, 5),
                                          Machine::array(machine_->found, 1)});
  if (!(*highest < scene_->velocity_limit)) {
    fail(TS_ERROR_ARGUMENT, "impulse would change velocities by %.4g m/s: stay below %g", double(*highest),
         scene_->velocity_limit);
  }
  is_still_ = false;
  rows_at_ = -1.0;
  Box box;
  for (int k = 0; k < 3; ++k) box.lower[k] = center[k] - radius, box.upper[k] = center[k] + radius;
  wake_near(box);
}

}  // namespace taichi_soft
