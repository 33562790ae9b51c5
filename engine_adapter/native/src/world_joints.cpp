// Joints, with the same results as taichi_soft/control/joints.py and embedding.py.

#include <algorithm>
#include <cmath>
#include <string>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

constexpr ts_joint kJoint = uint64_t(5) << 56;  // prefix of joint handles
constexpr double kLeastWeight = 1e-4;

}  // namespace

Vector World::vertex_place(int32_t slot, int32_t vertex) const {
  const size_t p = particle(slot, size_t(vertex));
  return {fields_.particle_position(p, 0), fields_.particle_position(p, 1), fields_.particle_position(p, 2)};
}

// Weights of points in tetrahedra whose `count` vertices are at `x`. Each point uses the tetrahedron in which its
// smallest weight is largest. Such a tetrahedron contains the point, if any does.
std::vector<World::Holder> World::embedded(const std::vector<Vector>& points, const double* x, size_t count,
                                           const Archive::View<int32_t>& tets) {
  const uint32_t k = uint32_t(points.size());
  const int32_t* corners = machine_->rows.room<int32_t>(4 * k);
  const double* weights = machine_->found.room<double>(4 * k);
  machine_->launch("embed_points", {Machine::array(points.data(), k, 3), Machine::array(x, uint32_t(count), 3),
                                    Machine::array(tets.data, uint32_t(tets.count / 4), 4),
                                    Machine::array(machine_->rows, k, 4), Machine::array(machine_->found, k, 4)});
  std::vector<Holder> holders(k);
  for (size_t i = 0; i < k; ++i) {
    std::copy(corners + 4 * i, corners + 4 * i + 4, holders[i].vertices);
    std::copy(weights + 4 * i, weights + 4 * i + 4, holders[i].weights);
  }
  return holders;
}

// Weights of points relative to the tetrahedra of the body in `other`, for its current shape. `name` describes a point.
std::vector<World::Holder> World::holders_at(const std::vector<Vector>& points, int32_t other,
                                             const std::function<std::string(size_t)>& name) {
  const Archive::View<int32_t>& tets = asset_of(other).tets;
  if (tets.count == 0) {
    fail(TS_ERROR_ARGUMENT,
         "the body in slot %d has no tetrahedra: join it to the other body instead, or give vertices in onto", other);
  }
  std::vector<Vector> x;
  for (size_t v = 0; v < asset_of(other).vertex_count(); ++v) x.push_back(vertex_place(other, int32_t(v)));
  std::vector<Holder> holders = embedded(points, x[0].data(), x.size(), tets);
  for (size_t i = 0; i < holders.size(); ++i) {
    auto& weights = holders[i].weights;
    // Points of a rigid body can be at any distance.
    if (!asset_of(other).is_rigid() && *std::min_element(weights, weights + 4) < kFarthest) {
      fail(TS_ERROR_ARGUMENT,
           "%s is too far from the body in slot %d: move the two together first, or give vertices in onto",
           name(i).c_str(), other);
    }
    double sum = 0.0;
    for (double& each : weights) {
      if (std::fabs(each) < kLeastWeight) each = 0.0;  // a rounding error must not become a weight
      sum += each;
    }
    for (double& each : weights) each = each / sum;
  }
  return holders;
}

// Weights of vertices of the body in `other`, in the first tetrahedron of which each is a corner, if any.
std::vector<World::Holder> World::holders_on(int32_t other, const std::vector<int32_t>& partners) const {
  const Archive::View<int32_t>& tets = asset_of(other).tets;
  std::vector<Holder> holders;
  for (int32_t vertex : partners) {
    Holder found{{vertex, vertex, vertex, vertex}, {0.0, 0.0, 0.0, 0.0}};
    if (tets.count > 0) {
      const auto at = std::find(tets.begin(), tets.end(), vertex);
      const size_t first = at == tets.end() ? 0 : size_t(at - tets.begin()) / 4 * 4;
      std::copy(tets.data + first, tets.data + first + 4, found.vertices);
    }
    const auto corner = std::find(found.vertices, found.vertices + 4, vertex);
    found.weights[corner == found.vertices + 4 ? 0 : corner - found.vertices] = 1.0;
    holders.push_back(found);
  }
  return holders;
}

namespace {

// Offsets of the points of a joint from its anchor, see `_spread` in taichi_soft/control/joints.py.
std::vector<Vector> spread_of(int32_t kind, const Vector& axis) {
  if (kind == TS_JOINT_BALL) return {{0.0, 0.0, 0.0}};
  const Vector back = {-axis[0], -axis[1], -axis[2]};
  if (kind == TS_JOINT_HINGE) return {axis, back};
  int least = 0;
  for (int k = 1; k < 3; ++k) {
    if (std::fabs(axis[size_t(k)]) < std::fabs(axis[size_t(least)])) least = k;
  }
  Vector unit = {0.0, 0.0, 0.0};
  unit[size_t(least)] = 1.0;
  Vector across = {axis[1] * unit[2] - axis[2] * unit[1], axis[2] * unit[0] - axis[0] * unit[2],
                   axis[0] * unit[1] - axis[1] * unit[0]};
  const double length = length_of(across);
  for (double& each : across) each = each / length;
  return {axis, back, across};
}

}  // namespace

// Direction in the frame of the principal axes of a rigid body.
Vector World::in_principal_axes(int32_t slot, const Vector& direction) const {
  constexpr double kSigns[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  Vector found;
  for (size_t i = 0; i < 3; ++i) {
    Vector axis = {0.0, 0.0, 0.0};
    for (int32_t v = 0; v < 4; ++v) {
      const Vector x = vertex_place(slot, v);
      for (size_t k = 0; k < 3; ++k) axis[k] = axis[k] + kSigns[v][i] * x[k];
    }
    found[i] = axis[0] * direction[0] + axis[1] * direction[1] + axis[2] * direction[2];
    found[i] = found[i] / (4.0 * asset_of(slot).rigid[1 + i]);
  }
  const double length = length_of(found);
  for (double& each : found) each = each / length;
  return found;
}

// Largest speed at which held vertices can follow their holder [m/s].
double World::follow_speed(int32_t slot, std::vector<int32_t> held) const {
  const Asset& asset = asset_of(slot);
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  double total = 0.0;
  for (double each : asset.masses) total += each;
  return asset.wave_speed * std::sqrt(mass_of(slot, held) / total);
}

size_t World::joint_rows() const {
  int32_t used = 0;
  for (size_t j = 0; j < kMostJoints; ++j) {
    if (fields_.joints.bodies(j, 0) != 0) used = std::max(used, fields_.joints.rows(j, 1));
  }
  return size_t(used);
}

ts_joint World::joint_at(int32_t number) const {
  if (number < 0 || size_t(number) >= kMostJoints) {
    fail(TS_ERROR_ARGUMENT, "number is %d: give 0 to %zu", number, kMostJoints - 1);
  }
  if (fields_.joints.bodies(size_t(number), 0) == 0) return 0;
  return kJoint | ts_joint(joint_generations_[size_t(number)]) << 32 | uint32_t(number + 1);
}

size_t World::joint_of(ts_joint joint) const {
  const int64_t number = int64_t(joint & 0xFFFFFFFFu) - 1;
  if (number < 0 || number >= int64_t(kMostJoints) || joint_at(int32_t(number)) != joint) {
    fail(TS_ERROR_HANDLE, "joint %llu is not in this world, or was released", static_cast<unsigned long long>(joint));
  }
  return size_t(number);
}

ts_joint World::join(int32_t slot, Vertices which, int32_t other, const int32_t* onto) {
  if (other == slot) fail(TS_ERROR_ARGUMENT, "other is the body itself: give another body");
  if (asset_of(slot).is_rigid()) {
    fail(TS_ERROR_ARGUMENT, "the body in slot %d is rigid: use ts_body_connect, which takes a point", slot);
  }
  const std::vector<int32_t> vertices = checked(slot, which, false);
  std::vector<Holder> holders, own;
  for (int32_t vertex : vertices) own.push_back({{vertex, vertex, vertex, vertex}, {1.0, 0.0, 0.0, 0.0}});
  if (onto == nullptr) {
    std::vector<Vector> points;
    for (int32_t vertex : vertices) points.push_back(vertex_place(slot, vertex));
    holders = holders_at(points, other, [&](size_t i) {
      return "vertex " + std::to_string(vertices[i]) + " of the body in slot " + std::to_string(slot);
    });
  } else {
    checked(other, {onto, which.count}, false);
    if (vertices.size() != which.count) fail(TS_ERROR_ARGUMENT, "a vertex is given twice: give each one once");
    std::vector<std::pair<int32_t, int32_t>> pairs;
    for (size_t i = 0; i < which.count; ++i) pairs.push_back({which.numbers[i], onto[i]});
    std::sort(pairs.begin(), pairs.end());
    std::vector<int32_t> partners;
    for (const auto& pair : pairs) partners.push_back(pair.second);
    holders = holders_on(other, partners);
  }
  return add_joint(slot, own, other, holders, {0.0, 0.0, 0.0});
}

ts_joint World::connect(int32_t slot, int32_t other, int32_t kind, const Vector& anchor, Vector axis) {
  if (other == slot) fail(TS_ERROR_ARGUMENT, "other is the body itself: give another body");
  if (kind < TS_JOINT_BALL || kind > TS_JOINT_FIXED) fail(TS_ERROR_ARGUMENT, "kind is %d: give 0 to 3", kind);
  const double length = length_of(axis);
  if (!(length > 0.0)) fail(TS_ERROR_ARGUMENT, "axis has zero length");
  for (double& each : axis) each = each / length;
  if (!asset_of(slot).is_rigid()) {
    fail(TS_ERROR_ARGUMENT, "the body in slot %d is not rigid: use ts_body_join, or give the rigid body first", slot);
  }
  if (kind == TS_JOINT_SLIDER && !asset_of(other).is_rigid()) {
    fail(TS_ERROR_ARGUMENT, "the body in slot %d is not rigid: a slider connects two rigid bodies", other);
  }
  const double size = kSpread * asset_of(slot).rigid[0];
  std::vector<Vector> points;
  for (const Vector& each : spread_of(kind, axis)) {
    points.push_back({anchor[0] + size * each[0], anchor[1] + size * each[1], anchor[2] + size * each[2]});
  }
  const auto name = [](size_t) { return std::string("the anchor"); };
  const std::vector<Holder> own = holders_at(points, slot, name), holders = holders_at(points, other, name);
  const Vector free_axis = kind == TS_JOINT_SLIDER ? in_principal_axes(other, axis) : Vector{0.0, 0.0, 0.0};
  return add_joint(slot, own, other, holders, free_axis);
}

// Joins points of a body to points of another one.
ts_joint World::add_joint(int32_t slot, const std::vector<Holder>& own, int32_t other,
                          const std::vector<Holder>& holders, const Vector& axis) {
  size_t j = 0;
  while (j < kMostJoints && fields_.joints.bodies(j, 0) != 0) ++j;
  if (j == kMostJoints) fail(TS_ERROR_STATE, "all %zu joints of this world are in use: release one first", kMostJoints);
  const size_t used = joint_rows(), n = own.size();
  if (used + n > kJointRows) {
    fail(TS_ERROR_STATE, "the joints of a world have at most %zu particles, and %zu are in use: release a joint first",
         kJointRows, used);
  }
  std::vector<int32_t> held, holding;
  int32_t* particles = machine_->rows.room<int32_t>(kJointEnds * n);
  float* weights = machine_->vertices.room<float>(kJointEnds * n);
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < 4; ++k) {
      particles[kJointEnds * i + k] = int32_t(particle(slot, size_t(own[i].vertices[k])));
      weights[kJointEnds * i + k] = as_float(own[i].weights[k]);
      if (own[i].weights[k] != 0.0) held.push_back(own[i].vertices[k]);
      particles[kJointEnds * i + 4 + k] = int32_t(particle(other, size_t(holders[i].vertices[k])));
      weights[kJointEnds * i + 4 + k] = as_float(-holders[i].weights[k]);
      if (holders[i].weights[k] != 0.0) holding.push_back(holders[i].vertices[k]);
    }
  }
  float* direction = machine_->numbers.room<float>(3);
  for (size_t k = 0; k < 3; ++k) direction[k] = as_float(axis[k]);
  const double speed = kDraw * std::min(follow_speed(slot, held), follow_speed(other, holding));
  wake_slot(other);
  const uint32_t count = uint32_t(n);
  machine_->launch(
      "write_joint",
      {Machine::whole(int32_t(j)), Machine::whole(slot), Machine::whole(other), Machine::whole(int32_t(used)),
       Machine::real(speed), Machine::array(machine_->numbers, 3), Machine::array(machine_->rows, count, kJointEnds),
       Machine::array(machine_->vertices, count, kJointEnds)});
  mark_modified(slot);
  joint_generations_[j] = (joint_generations_[j] + 1) & 0xFFFFFF;
  joints_have_changed();
  return joint_at(int32_t(j));
}

void World::release_joint(ts_joint joint) { end_joint(joint_of(joint)); }

void World::end_joint(size_t j) {
  const int32_t body = fields_.joints.bodies(j, 0) - 1;
  wake_slot(fields_.joints.bodies(j, 1) - 1);
  machine_->launch("end_joint", {Machine::whole(int32_t(j))});
  mark_modified(body);
  joints_have_changed();
}

void World::set_break_force(ts_joint joint, double force) {
  const size_t j = joint_of(joint);
  if (!(force >= 0.0 && force <= kMostBreakForce)) {
    fail(TS_ERROR_ARGUMENT, "force is %g: give a force of 0 to %g N, 0 to never break", force, kMostBreakForce);
  }
  fields_.joints.break_force(j) = as_float(force);
}

// Releases the joints whose mean force in the last step exceeds their limit.
void World::break_joints(double dt) {
  for (size_t j = 0; j < kMostJoints; ++j) {
    const double most = double(fields_.joints.break_force(j)) * dt;
    if (fields_.joints.bodies(j, 0) == 0 || !(most > 0.0)) continue;
    const double x = fields_.joints.impulse(j, 0), y = fields_.joints.impulse(j, 1), z = fields_.joints.impulse(j, 2);
    if (!(x * x + y * y + z * z > most * most)) continue;
    const ts_body body = body_in(fields_.joints.bodies(j, 0) - 1), other = body_in(fields_.joints.bodies(j, 1) - 1);
    events_.tell({TS_BROKE, -1, steps_ - 1, time_, body, other, {x, y, z}, 0.0});
    end_joint(j);
  }
}

// Joined bodies are stepped together, even in worlds that do not search for contacts.
void World::joints_have_changed() {
  if (scene_->has_soft_contact) return;
  machine_->launch("list_joined_islands", {Machine::whole(scene_->slot_count)});
}

Vector World::joint_force(ts_joint joint) const {
  const size_t j = joint_of(joint);
  const double dt = std::max(last_dt_, 1e-30);
  return {fields_.joints.impulse(j, 0) / dt, fields_.joints.impulse(j, 1) / dt, fields_.joints.impulse(j, 2) / dt};
}

}  // namespace taichi_soft
