// Motion of a body whose level of detail changes, and nearest vertices between its levels.
#pragma once

#include <vector>

#include "rotations.hpp"
#include "scene.hpp"

namespace taichi_soft {

// Numbers of the rows of `read_motion` in taichi_soft/fracture/kernels/topology.py.
struct Motion {
  enum Column : size_t { kPosition = 0, kInvMass = 12, kTarget = 17, kReaction = 23, kWidth = 26 };

  explicit Motion(size_t rows) : count(rows), numbers(kWidth * rows, 0.0) {}
  double& operator()(size_t row, size_t column) { return numbers[kWidth * row + column]; }
  double operator()(size_t row, size_t column) const { return numbers[kWidth * row + column]; }

  size_t count;
  std::vector<double> numbers;
};

// Vertices of the target that are nearest at rest to given vertices of the source, unique and ascending.
std::vector<int32_t> nearest_vertices(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// Nearest vertex of the target for each given vertex, in order.
std::vector<int32_t> nearest_of_each(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// Nearest vertex of the source at rest for each given vertex of the target.
std::vector<int32_t> nearest_sources(const Asset& source, const std::vector<int32_t>& among, const Asset& target,
                                     const std::vector<int32_t>& vertices);

}  // namespace taichi_soft
