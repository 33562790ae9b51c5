// Transfers a body from one level of detail to another, bit-identical to taichi_soft/levels.
#pragma once

#include <vector>

#include "rotations.hpp"
#include "scene.hpp"

namespace taichi_soft {

// Rows of `read_motion` in taichi_soft/fracture/kernels/topology.py.
struct Motion {
  enum Column : size_t {
    kPosition = 0,
    kVelocity = 3,
    kEarlierPosition = 6,
    kEarlierVelocity = 9,
    kPassing = 12,  // columns that are transferred unchanged
    kInvMass = 12,
    kMass = 15,
    kAim = 16,
    kTarget = 17,
    kPush = 20,
    kReaction = 23,
    kWidth = 26
  };

  explicit Motion(size_t rows) : count(rows), numbers(kWidth * rows, 0.0) {}
  double& operator()(size_t row, size_t column) { return numbers[kWidth * row + column]; }
  double operator()(size_t row, size_t column) const { return numbers[kWidth * row + column]; }
  Vector at(size_t row, size_t column) const {
    return {(*this)(row, column), (*this)(row, column + 1), (*this)(row, column + 2)};
  }
  void put(size_t row, size_t column, const Vector& vector) {
    for (size_t k = 0; k < 3; ++k) (*this)(row, column + k) = vector[k];
  }

  size_t count;
  std::vector<double> numbers;
};

// A body whose level of detail changes.
struct Change {
  const Asset &source, &target;  // levels of one asset
  const Passage& over;
  std::vector<int32_t> held;     // held vertices of the target
};

// Unique vertices of the target, ascending, that are nearest at rest to given vertices of the source.
std::vector<int32_t> nearest_vertices(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// Nearest vertex of the target for each given vertex, in order.
std::vector<int32_t> nearest_of_each(const Asset& source, const std::vector<int32_t>& vertices, const Asset& target);
// Nearest vertex of the source at rest for each given vertex of the target.
std::vector<int32_t> nearest_sources(const Asset& source, const std::vector<int32_t>& among, const Asset& target,
                                     const std::vector<int32_t>& vertices);

Motion passed(const Change& change, const Motion& before);

}  // namespace taichi_soft
