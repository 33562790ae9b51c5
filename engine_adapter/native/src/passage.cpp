#include "passage.hpp"

#include <algorithm>
#include <limits>

namespace taichi_soft {

namespace {

Vector rest_place(const Asset& asset, int32_t vertex) {
  const double* at = asset.vertices.data + 3 * size_t(vertex);
  return {at[0], at[1], at[2]};
}

// Vertex in `among` that is nearest to a rest position. Among equally near vertices, the first in the list.
int32_t nearest_vertex(const Asset& asset, const std::vector<int32_t>& among, const Vector& place) {
  double least = std::numeric_limits<double>::infinity();
  int32_t found = among[0];
  for (int32_t vertex : among) {
    const Vector other = rest_place(asset, vertex);
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) square += (place[k] - other[k]) * (place[k] - other[k]);
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

}  // namespace taichi_soft
