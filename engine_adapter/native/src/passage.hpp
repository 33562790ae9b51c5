// Motion of a body whose level of detail changes, and searches for nearest vertices of another level.
#pragma once

#include <vector>

#include "rotations.hpp"
#include "scene.hpp"

namespace taichi_soft {

// Motion of all vertices, in the layout of `read_motion` in taichi_soft/fracture/kernels/topology.py.
struct Motion {
  enum Column : size_t { kPosition = 0, kInvMass = 12, kTarget = 17, kReaction = 23, kWidth = 26 };

  explicit Motion(size_t rows) : count(rows), numbers(kWidth * rows, 0.0) {}
  double& operator()(size_t row, size_t column) { return numbers[kWidth * row + column]; }
  double operator()(size_t row, size_t column) const { return numbers[kWidth * row + column]; }

  size_t count;
  std::vector<double> numbers;
};

// For each vertex in `vertices` of the source, finds the vertex of the target that is nearest at rest. Returns: unique
// vertices in ascending order.
std::vector<int32_t> nearest_vertices(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// Like `nearest_vertices`, but returns one vertex of the target for each vertex in `vertices`, in the same order.
std::vector<int32_t> nearest_of_each(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// For each vertex in `vertices` of the target, finds the vertex in `among` of the source that is nearest at rest.
std::vector<int32_t> nearest_sources(const Asset& source, const std::vector<int32_t>& among, const Asset& target,
                                     const std::vector<int32_t>& vertices);

}  // namespace taichi_soft
