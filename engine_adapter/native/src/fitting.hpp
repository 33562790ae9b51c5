// Best-fitting rotation of a shape: the same as taichi_soft/levels/rigid_fit.py, and equal to taichi_soft/bodies/pose.py
// in the precision of a 32-bit float.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "rotations.hpp"

namespace taichi_soft {

// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
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

// The rotation R with the largest trace of R^T m (Horn 1987); the identity for a zero matrix.
inline Matrix nearest_rotation(const Matrix& m) {
  const std::array<std::array<double, 4>, 4> square = {
      {{m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]},
       {m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1], m[0][2] - m[2][0]},
       {m[0][2] + m[2][0], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1], m[1][0] - m[0][1]},
       {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], m[0][0] + m[1][1] + m[2][2]}}};
  const Eigen<4> found(square);
  size_t best = 3;
  for (size_t i = 0; i < 3; ++i) {
    if (found.values[i] > found.values[best]) best = i;
  }
  Quaternion q;
  for (size_t k = 0; k < 4; ++k) q[k] = found.vectors[k][best];
  const double length = length_of(q);
  for (double& each : q) each = each / length;
  return matrix_of(q);
}

inline Vector weighted_sum(const std::vector<double>& weights, const std::vector<Vector>& rows) {
  Vector found = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) found[k] += weights[i] * rows[i][k];
  }
  return found;
}

// Sum of w a b^T.
inline Matrix moments(const std::vector<double>& weights, const std::vector<Vector>& a, const std::vector<Vector>& b) {
  Matrix found{};
  for (size_t n = 0; n < a.size(); ++n) {
    for (size_t i = 0; i < 3; ++i) {
      for (size_t k = 0; k < 3; ++k) found[i][k] += weights[n] * a[n][i] * b[n][k];
    }
  }
  return found;
}

inline std::vector<Vector> beside(std::vector<Vector> points, const Vector& center) {
  for (Vector& each : points) each = {each[0] - center[0], each[1] - center[1], each[2] - center[2]};
  return points;
}

// Rigid motion of a shape since its rest state. `shares` have the sum 1.
struct FittingMotion {
  Matrix turn;
  Vector place;  // position of the origin
};

inline FittingMotion fitting_motion(const std::vector<Vector>& rest, const std::vector<Vector>& now,
                                    const std::vector<double>& shares) {
  constexpr double kLeaning = 1e-10;
  const Vector rest_center = weighted_sum(shares, rest), center = weighted_sum(shares, now);
  const std::vector<Vector> arms = beside(rest, rest_center);
  Matrix moment = moments(shares, beside(now, center), arms);
  const Matrix spread = moments(shares, arms, arms);
  for (size_t i = 0; i < 3; ++i) moment[i][i] += kLeaning * (spread[0][0] + spread[1][1] + spread[2][2]);
  const Matrix turn = nearest_rotation(moment);
  const Vector carried = turned(rest_center, turn);
  return {turn, {center[0] - carried[0], center[1] - carried[1], center[2] - carried[2]}};
}

// Rounds a vector to 32-bit floats, the same as `kept` in taichi_soft/core/residue.py.
inline Vector kept(const Vector& vector) {
  constexpr double kResidue = 1e-12;
  double size = 0.0;
  for (double each : vector) size = std::max(size, std::fabs(each));
  Vector found;
  for (size_t k = 0; k < 3; ++k) {
    found[k] = std::fabs(vector[k]) > kResidue * size ? double(static_cast<float>(vector[k])) : 0.0;
  }
  return found;
}

}  // namespace taichi_soft
