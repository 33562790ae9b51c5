#include "colliders.hpp"

#include <algorithm>

#include "error.hpp"
#include "split.hpp"

namespace taichi_soft {

namespace {

bool is_zero(const Vector& v) { return v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0; }

Pose pose_from(const double* row) { return {{row[0], row[1], row[2]}, {row[3], row[4], row[5], row[6]}}; }

}  // namespace

bool Collider::moves() const { return has_target || !is_zero(velocity) || !is_zero(spin); }

Box Collider::way(double dt, double* fastest) const {
  const double speed = length_of(velocity), turning = length_of(spin);
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(bounds.lower[i]) || !std::isfinite(bounds.upper[i])) {
      *fastest = turning == 0.0 ? speed : 1e30;
      return {{-1e30, -1e30, -1e30}, {1e30, 1e30, 1e30}};
    }
  }
  const Matrix turn = matrix_of(pose.rotation);
  double radius = 0.0;
  Vector places[8];
  for (int i = 0; i < 8; ++i) {
    Vector corner;
    for (int k = 0; k < 3; ++k) corner[k] = (i >> k & 1) == 0 ? bounds.lower[k] : bounds.upper[k];
    radius = std::max(radius, std::sqrt(corner[0] * corner[0] + corner[1] * corner[1] + corner[2] * corner[2]));
    places[i] = turned(corner, turn);
  }
  int count = 8;
  if (turning > 0.0) {
    count = 2;
    places[0] = {-radius, -radius, -radius};
    places[1] = {radius, radius, radius};
  }
  Box found;
  for (int k = 0; k < 3; ++k) {
    const double end = pose.position[k] + dt * velocity[k];
    double least = pose.position[k] + places[0][k], most = least;
    for (int i = 0; i < count; ++i) {
      for (double at : {pose.position[k] + places[i][k], end + places[i][k]}) {
        least = std::min(least, at);
        most = std::max(most, at);
      }
    }
    found.lower[k] = least - skin;
    found.upper[k] = most + skin;
  }
  *fastest = speed + turning * (radius + skin);
  return found;
}

Colliders::Colliders(const Archive& archive) {
  const auto alive = archive.get<int32_t>("colliders/alive"), sensor = archive.get<int32_t>("colliders/sensor");
  const auto pose = archive.rows<double>("colliders/pose", 7), motion = archive.rows<double>("colliders/motion", 6);
  const auto target = archive.rows<double>("colliders/target", 8), bounds = archive.rows<double>("colliders/bounds", 6);
  const auto skin = archive.get<double>("colliders/skin"), seams = archive.get<double>("colliders/seam");
  const auto kind = archive.get<int32_t>("colliders/kind"), filter = archive.rows<int32_t>("colliders/filter", 2);
  const auto parameters = archive.rows<float>("colliders/parameters", 8);
  const auto surface = archive.rows<double>("colliders/surface", 2);
  const auto conveyor = archive.rows<double>("colliders/surface_velocity", 3);
  const size_t n = alive.count;
  if (kind.count != n || filter.count != 2 * n || parameters.count != 8 * n || surface.count != 2 * n ||
      conveyor.count != 3 * n || sensor.count != n || seams.count != 1 || pose.count != 7 * n ||
      motion.count != 6 * n || target.count != 8 * n || bounds.count != 6 * n || skin.count != n) {
    fail(TS_ERROR_FILE, "the world file is invalid: colliders. Export it again");
  }
  seam = seams[0];
  for (size_t i = 0; i < n; ++i) {
    const double *m = motion.data + 6 * i, *b = bounds.data + 6 * i, *v = conveyor.data + 3 * i;
    rows.push_back({alive[i] != 0,
                    pose_from(pose.data + 7 * i),
                    {m[0], m[1], m[2]},
                    {m[3], m[4], m[5]},
                    target[8 * i] != 0.0,
                    pose_from(target.data + 8 * i + 1),
                    {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}},
                    skin[i],
                    kind[i],
                    {},
                    surface[2 * i],
                    surface[2 * i + 1],
                    filter[2 * i],
                    filter[2 * i + 1],
                    {v[0], v[1], v[2]},
                    sensor[i] != 0,
                    1});
    std::copy(parameters.data + 8 * i, parameters.data + 8 * i + 8, rows.back().parameters);
  }
}

int32_t Colliders::free_row() const {
  size_t row = 0;
  while (row < rows.size() && rows[row].is_alive) ++row;
  return int32_t(row);
}

bool Colliders::prepare(double dt, std::vector<ColliderMotion>* motion) {
  bool any_moves = false;
  for (Collider& row : rows) {
    any_moves = any_moves || (row.moves() && !row.is_sensor);
    if (!row.has_target) continue;
    const Vector turn = rotation_vector(row.pose.rotation, row.target.rotation);
    for (int k = 0; k < 3; ++k) {
      row.velocity[k] = (row.target.position[k] - row.pose.position[k]) / dt;
      row.spin[k] = turn[k] / dt;
    }
  }
  if (!is_dirty && !any_moves) return false;
  motion->clear();
  for (const Collider& row : rows) {
    double fastest = 0.0;
    const Box way = row.way(dt, &fastest);
    ColliderMotion line;
    for (int k = 0; k < 3; ++k) {
      line.position[k] = static_cast<float>(row.pose.position[k]);
      const float x = static_cast<float>(row.pose.position[k]);
      line.residue[k] = residue_of(x, static_cast<float>(row.pose.position[k] - double(x)));
      line.velocity[k] = static_cast<float>(row.velocity[k]);
      line.spin[k] = static_cast<float>(row.spin[k]);
      line.lower[k] = static_cast<float>(way.lower[k]);
      line.upper[k] = static_cast<float>(way.upper[k]);
    }
    for (int k = 0; k < 4; ++k) line.rotation[k] = static_cast<float>(row.pose.rotation[k]);
    line.speed = row.is_sensor ? 0.0f : static_cast<float>(fastest);  // with this speed, colliders wake bodies
    motion->push_back(line);
  }
  is_dirty = false;
  return true;
}

void Colliders::finish(double dt) {
  for (Collider& row : rows) {
    if (!row.moves()) continue;
    if (row.has_target) {
      row.pose = row.target;
      row.velocity = row.spin = {0.0, 0.0, 0.0};
      row.has_target = false;
      is_dirty = is_dirty || !row.is_sensor;
    } else {
      for (int k = 0; k < 3; ++k) row.pose.position[k] = row.pose.position[k] + dt * row.velocity[k];
      row.pose.rotation = turned_by(row.pose.rotation, {dt * row.spin[0], dt * row.spin[1], dt * row.spin[2]});
    }
  }
}

}  // namespace taichi_soft
