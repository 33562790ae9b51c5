// Rotations, bit-identical to taichi_soft/core/math/rotations.py.
#pragma once

#include <array>
#include <cmath>
#include <utility>

namespace taichi_soft {

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // x, y, z, w
using Matrix = std::array<Vector, 3>;      // rows

template <size_t N>
double length_of(const std::array<double, N>& vector) {
  double total = 0.0;
  for (double each : vector) total += each * each;
  return std::sqrt(total);
}

inline Matrix matrix_of(const Quaternion& q) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}};
}

inline Vector turned(const Vector& v, const Matrix& m) {
  Vector found;
  for (int i = 0; i < 3; ++i) found[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return found;
}

inline Quaternion quaternion_of(const Matrix& m) {
  const double trace = m[0][0] + m[1][1] + m[2][2];
  const double skew[3] = {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]};
  double square[4][4];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) square[i][j] = m[i][j] + m[j][i] + (1.0 - trace) * (i == j ? 1.0 : 0.0);
    square[3][i] = square[i][3] = skew[i];
  }
  square[3][3] = 1.0 + trace;
  int longest = 0;
  for (int i = 1; i < 4; ++i) {
    if (square[i][i] > square[longest][longest]) longest = i;
  }
  Quaternion row = {square[longest][0], square[longest][1], square[longest][2], square[longest][3]};
  const double length = length_of(row);
  for (double& each : row) each = each / length;
  if (row[3] < 0) {
    for (double& each : row) each = -each;
  }
  return row;
}

inline Quaternion multiplied(const Quaternion& second, const Quaternion& first) {
  const double a = second[0], b = second[1], c = second[2], w = second[3];
  const double d = first[0], e = first[1], f = first[2], u = first[3];
  return {w * d + u * a + (b * f - c * e), w * e + u * b + (c * d - a * f), w * f + u * c + (a * e - b * d),
          w * u - (a * d + b * e + c * f)};
}

// Cosine and sine of an angle [rad], bit-identical to Python. Different C libraries would return different last bits.
inline std::pair<double, double> cos_sin(double angle) {
  constexpr double whole = 6.283185307179586;
  const double part = (angle - whole * std::floor(angle / whole + 0.5)) / 8.0, square = part * part;
  double behind = 0.0, versine = 0.0;
  for (int k = 16; k > 0; k -= 2) {
    behind = (1.0 - behind) * square / (k * (k + 1));
    versine = (1.0 - versine) * square / (k * (k - 1));
  }
  double sine = part * (1.0 - behind);
  for (int i = 0; i < 3; ++i) {
    const double before = sine;
    sine = 2.0 * before * (1.0 - versine);
    versine = 2.0 * before * before;
  }
  return {1.0 - versine, sine};
}

// Angle [rad] with a sine and a cosine. The cosine must be 0 or more.
inline double angle_of(double sine, double cosine) {
  double tangent = sine / (1.0 + cosine);
  tangent = tangent / (1.0 + std::sqrt(1.0 + tangent * tangent));
  const double square = tangent * tangent;
  double behind = 0.0;
  for (int k = 41; k > 1; k -= 2) behind = square * (1.0 / k - behind);
  return 4.0 * tangent * (1.0 - behind);
}

// Shortest rotation from one quaternion to another, as axis times angle [rad].
inline Vector rotation_vector(const Quaternion& start, const Quaternion& end) {
  Quaternion turn = multiplied(end, {-start[0], -start[1], -start[2], start[3]});
  if (turn[3] < 0) {
    for (double& each : turn) each = -each;
  }
  Vector axis = {turn[0], turn[1], turn[2]};
  const double sine = length_of(axis);
  if (sine < 1e-12) {
    for (double& each : axis) each = 2.0 * each;
    return axis;
  }
  const double angle = 2.0 * angle_of(sine, turn[3]);
  for (double& each : axis) each = each / sine * angle;
  return axis;
}

inline Quaternion turned_by(const Quaternion& quaternion, const Vector& vector) {
  const double angle = length_of(vector);
  const auto [cosine, sine] = cos_sin(0.5 * angle);
  const double share = angle == 0.0 ? 0.5 : sine / angle;
  Quaternion result =
      multiplied({vector[0] * share, vector[1] * share, vector[2] * share, cosine}, quaternion);
  const double length = length_of(result);
  for (double& each : result) each = each / length;
  return result;
}

}  // namespace taichi_soft
