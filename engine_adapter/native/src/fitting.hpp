// How a shape has turned, as taichi_soft/bodies/pose.py finds it. Only digits that a 32-bit float keeps are the same.
#pragma once

#include <cmath>

#include "rotations.hpp"

namespace taichi_soft {

// Eigenvalues and, in columns, eigenvectors of a symmetric matrix, by rotations of Jacobi.
template <size_t N>
struct Eigen {
  std::array<double, N> values;
  std::array<std::array<double, N>, N> vectors;

  explicit Eigen(std::array<std::array<double, N>, N> m) {
    for (size_t i = 0; i < N; ++i) {
      for (size_t k = 0; k < N; ++k) vectors[i][k] = i == k ? 1.0 : 0.0;
    }
    for (int sweep = 0; sweep < 30; ++sweep) {
      for (size_t p = 0; p < N; ++p) {
        for (size_t q = p + 1; q < N; ++q) turn(&m, p, q);
      }
    }
    for (size_t i = 0; i < N; ++i) values[i] = m[i][i];
  }

 private:
  void turn(std::array<std::array<double, N>, N>* m, size_t p, size_t q) {
    auto& a = *m;
    if (a[p][q] == 0.0) return;
    const double slope = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    const double t = (slope < 0.0 ? -1.0 : 1.0) / (std::fabs(slope) + std::sqrt(slope * slope + 1.0));
    const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
    for (size_t k = 0; k < N; ++k) {
      const double x = a[k][p], y = a[k][q];
      a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
    }
    for (size_t k = 0; k < N; ++k) {
      const double x = a[p][k], y = a[q][k];
      a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
    }
    for (size_t k = 0; k < N; ++k) {
      const double x = vectors[k][p], y = vectors[k][q];
      vectors[k][p] = c * x - s * y, vectors[k][q] = s * x + c * y;
    }
  }
};

// The rotation R with the largest trace of R^T m: Horn 1987.
inline Matrix nearest_rotation(const Matrix& m) {
  const std::array<std::array<double, 4>, 4> square = {
      {{m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]},
       {m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1], m[0][2] - m[2][0]},
       {m[0][2] + m[2][0], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1], m[1][0] - m[0][1]},
       {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], m[0][0] + m[1][1] + m[2][2]}}};
  const Eigen<4> found(square);
  size_t best = 0;
  for (size_t i = 1; i < 4; ++i) {
    if (found.values[i] > found.values[best]) best = i;
  }
  Quaternion q;
  for (size_t k = 0; k < 4; ++k) q[k] = found.vectors[k][best];
  const double length = length_of(q);
  for (double& each : q) each = each / length;
  return matrix_of(q);
}

}  // namespace taichi_soft
