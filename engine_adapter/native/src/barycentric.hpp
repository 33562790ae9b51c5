// Barycentric coordinates of points in tetrahedra, the same as taichi_soft/core/math/barycentric.py.
#pragma once

#include <array>
#include <cmath>

#include "rotations.hpp"

namespace taichi_soft {

inline Vector difference(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

class Coordinates {
 public:
  explicit Coordinates(const Vector corners[4]) : start_(corners[0]) {
    const Vector a = difference(corners[1], start_), b = difference(corners[2], start_),
                 c = difference(corners[3], start_);
    const Vector normals[3] = {cross(b, c), cross(c, a), cross(a, b)};
    volume6_ = dot(a, normals[0]);
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) inverse_[i][k] = normals[i][k] / volume6_;
    }
  }
  bool is_solid() const { return std::fabs(volume6_) > 1e-30; }
  std::array<double, 4> of(const Vector& point) const {
    const Vector arm = difference(point, start_);
    const Vector rest = {dot(inverse_[0], arm), dot(inverse_[1], arm), dot(inverse_[2], arm)};
    return {1.0 - (rest[0] + rest[1] + rest[2]), rest[0], rest[1], rest[2]};
  }

 private:
  Vector start_, inverse_[3];
  double volume6_;
};

}  // namespace taichi_soft
