#include "passage.hpp"

#include <algorithm>
#include <limits>

#include "fitting.hpp"

namespace taichi_soft {

namespace {

using Column = Motion::Column;
using Points = std::vector<Vector>;
using Numbers = std::vector<double>;

// Sums numbers `stride` apart, in the same order as NumPy.
double sum_of(const double* numbers, size_t count, size_t stride) {
  if (count < 8) {
    double total = -0.0;
    for (size_t i = 0; i < count; ++i) total += numbers[i * stride];
    return total;
  }
  if (count > 128) {
    const size_t half = count / 2 / 8 * 8;
    return sum_of(numbers, half, stride) + sum_of(numbers + half * stride, count - half, stride);
  }
  double r[8];
  for (size_t k = 0; k < 8; ++k) r[k] = numbers[k * stride];
  size_t i = 8;
  for (; i + 8 <= count; i += 8) {
    for (size_t k = 0; k < 8; ++k) r[k] += numbers[(i + k) * stride];
  }
  double total = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
  for (; i < count; ++i) total += numbers[i * stride];
  return total;
}

double sum_of(const Numbers& numbers) { return 0.0 + sum_of(numbers.data(), numbers.size(), 1); }

Vector difference(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector plus(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vector over(const Vector& a, double number) { return {a[0] / number, a[1] / number, a[2] / number}; }

Points points_of(const Motion& motion, size_t column) {
  Points found(motion.count);
  for (size_t i = 0; i < motion.count; ++i) found[i] = motion.at(i, column);
  return found;
}

Vector rest_place(const Asset& asset, int32_t vertex) {
  const double* at = asset.vertices.data + 3 * size_t(vertex);
  return {at[0], at[1], at[2]};
}

// Sum of m r x v.
Vector spin_of(const Points& arms, const Points& v, const Numbers& masses) {
  const Matrix p = moments(masses, arms, v);
  return {p[1][2] - p[2][1], p[2][0] - p[0][2], p[0][1] - p[1][0]};
}

Points rigid(Points arms, const Numbers& masses, const Vector& momentum, const Vector& spin) {
  const double mass = sum_of(masses);
  const Vector off = over(weighted_sum(masses, arms), mass);
  for (Vector& each : arms) each = difference(each, off);
  Matrix inertia = moments(masses, arms, arms);
  const double trace = (inertia[0][0] + inertia[1][1] + inertia[2][2]) * (1.0 + 1e-9);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k) inertia[i][k] = trace * (i == k ? 1.0 : 0.0) - inertia[i][k];
  }
  const Vector normals[3] = {cross(inertia[1], inertia[2]), cross(inertia[2], inertia[0]),
                             cross(inertia[0], inertia[1])};
  const Vector& first = normals[0];
  const double volume = inertia[0][0] * first[0] + inertia[0][1] * first[1] + inertia[0][2] * first[2];
  Vector turn;
  for (size_t i = 0; i < 3; ++i) {
    const Vector row = over(normals[i], volume);
    turn[i] = row[0] * spin[0] + row[1] * spin[1] + row[2] * spin[2];
  }
  const double a = turn[0], b = turn[1], c = turn[2];
  const Matrix turning = {{{0, -c, b}, {c, 0, -a}, {-b, a, 0}}};
  const Vector drift = over(momentum, mass);
  for (Vector& each : arms) each = plus(drift, turned(each, turning));
  return arms;
}

// Corrects positions and velocities to keep the centre of mass, momentum and angular momentum.
void keep_momentum(const Motion& before, const Numbers& m, Motion* after, const Numbers& masses, size_t x, size_t v) {
  Points old_x = points_of(before, x), new_x = points_of(*after, x), new_v = points_of(*after, v);
  const Points old_v = points_of(before, v);
  const Vector center = over(weighted_sum(m, old_x), sum_of(m));
  const Vector move = difference(center, over(weighted_sum(masses, new_x), sum_of(masses)));
  Points arms(new_x.size());
  for (size_t i = 0; i < new_x.size(); ++i) {
    new_x[i] = plus(new_x[i], move);
    arms[i] = difference(new_x[i], center);
  }
  const Vector momentum = difference(weighted_sum(m, old_v), weighted_sum(masses, new_v));
  for (Vector& each : old_x) each = difference(each, center);
  const Points more = rigid(arms, masses, momentum, difference(spin_of(old_x, old_v, m), spin_of(arms, new_v, masses)));
  for (size_t i = 0; i < new_x.size(); ++i) {
    after->put(i, x, new_x[i]);
    after->put(i, v, plus(new_v[i], more[i]));
  }
}

// Holds vertices like the nearest held vertices of the previous level.
void hold(const Change& change, const Motion& before, Motion* after) {
  std::vector<int32_t> sources;
  for (size_t i = 0; i < before.count; ++i) {
    if (before(i, Column::kInvMass) == 0.0) sources.push_back(int32_t(i));
  }
  const std::vector<int32_t> nearest = nearest_sources(change.source, sources, change.target, change.held);
  for (size_t part : {size_t(Column::kPosition), size_t(Column::kEarlierPosition)}) {
    Points rest, now;
    for (int32_t vertex : sources) {
      rest.push_back(rest_place(change.source, vertex));
      now.push_back(before.at(size_t(vertex), part));
    }
    FittingMotion fit = fitting_motion(rest, now, Numbers(rest.size(), 1.0 / double(rest.size())));
    for (Vector& row : fit.turn) row = kept(row);
    fit.place = kept(fit.place);
    const auto carried = [&](const Vector& place) { return plus(turned(place, fit.turn), fit.place); };
    for (size_t i = 0; i < nearest.size(); ++i) {
      const Vector beside =
          difference(before.at(size_t(nearest[i]), part), carried(rest_place(change.source, nearest[i])));
      after->put(size_t(change.held[i]), part, plus(carried(rest_place(change.target, change.held[i])), beside));
    }
  }
  for (size_t i = 0; i < nearest.size(); ++i) {
    const size_t vertex = size_t(change.held[i]), from = size_t(nearest[i]);
    (*after)(vertex, Column::kInvMass) = 0.0;
    after->put(vertex, Column::kVelocity, before.at(from, Column::kVelocity));
    (*after)(vertex, Column::kAim) = before(from, Column::kAim);
    after->put(vertex, Column::kTarget,
               difference(plus(before.at(from, Column::kTarget), after->at(vertex, Column::kPosition)),
                     before.at(from, Column::kPosition)));
  }
}

// Interpolates the target's vertices from the source's.
void pass_over(const Passage& over, const Motion& before, Motion* after) {
  Numbers products;
  for (size_t vertex = 0; vertex < after->count; ++vertex) {
    const size_t begin = size_t(over.begins[vertex]);
    const size_t end = vertex + 1 < after->count ? size_t(over.begins[vertex + 1]) : over.sources.count;
    for (size_t column = 0; column < Column::kPassing; ++column) {
      products.clear();
      for (size_t i = begin; i < end; ++i) products.push_back(before(size_t(over.sources[i]), column) * over.weights[i]);
      double total = products[0];
      if (products.size() > 1) total = total + sum_of(products.data() + 1, products.size() - 1, 1);
      (*after)(vertex, column) = total;
    }
  }
}

// Vertex of a list that is nearest to a rest position; the first one of equals.
int32_t nearest_vertex(const Asset& asset, const std::vector<int32_t>& among, const Vector& place) {
  double least = std::numeric_limits<double>::infinity();
  int32_t found = among[0];
  for (int32_t vertex : among) {
    const Vector way = difference(place, rest_place(asset, vertex));
    const double square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    if (square < least) least = square, found = vertex;
  }
  return found;
}

}  // namespace

std::vector<int32_t> nearest_of_each(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target) {
  std::vector<int32_t> all(target.vertex_count()), found;
  for (size_t i = 0; i < all.size(); ++i) all[i] = int32_t(i);
  for (int32_t vertex : vertices) found.push_back(nearest_vertex(target, all, rest_place(source, vertex)));
  return found;
}

std::vector<int32_t> nearest_vertices(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target) {
  std::vector<int32_t> found = nearest_of_each(source, vertices, target);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

std::vector<int32_t> nearest_sources(const Asset& source, const std::vector<int32_t>& among, const Asset& target,
                                     const std::vector<int32_t>& vertices) {
  std::vector<int32_t> found;
  for (int32_t vertex : vertices) found.push_back(nearest_vertex(source, among, rest_place(target, vertex)));
  return found;
}

Motion passed(const Change& change, const Motion& before) {
  Motion after(change.target.vertex_count());
  const Numbers masses(change.target.masses.begin(), change.target.masses.end());
  Numbers old(before.count);
  for (size_t i = 0; i < before.count; ++i) old[i] = before(i, Column::kMass);
  pass_over(change.over, before, &after);
  for (size_t i = 0; i < after.count; ++i) {
    after(i, Column::kMass) = masses[i];
    after(i, Column::kInvMass) = 1.0 / masses[i];
  }
  if (!change.held.empty()) {
    hold(change, before, &after);
  } else {
    keep_momentum(before, old, &after, masses, Column::kPosition, Column::kVelocity);
    keep_momentum(before, old, &after, masses, Column::kEarlierPosition, Column::kEarlierVelocity);
  }
  const Vector center = over(weighted_sum(old, points_of(before, Column::kPosition)), sum_of(old));
  Vector force = {0.0, 0.0, 0.0}, torque = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < before.count; ++i) {
    const Vector push = before.at(i, Column::kPush);
    force = plus(force, push);
    torque = plus(torque, cross(difference(before.at(i, Column::kPosition), center), push));
  }
  Points arms = points_of(after, Column::kPosition);
  for (Vector& each : arms) each = difference(each, center);
  const Points pushes = rigid(arms, masses, force, torque);
  for (size_t i = 0; i < after.count; ++i) {
    for (size_t k = 0; k < 3; ++k) after(i, Column::kPush + k) = masses[i] * pushes[i][k];
  }
  return after;
}

}  // namespace taichi_soft
