#include "variants.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taichi_soft_godot {

const Variant& Arguments::typed(int which, Type type) const {
  if (type_of(*values_[which]) != type) {
    throw Refused("argument " + std::to_string(which + 1) + " is not a " + type_name(type));
  }
  return *values_[which];
}

int64_t Arguments::whole(int which) const { return whole_of(typed(which, Type::whole)); }

int32_t Arguments::small(int which) const {
  const int64_t found = whole(which);
  if (found < std::numeric_limits<int32_t>::min() || found > std::numeric_limits<int32_t>::max()) {
    throw Refused("argument " + std::to_string(which + 1) + " is " + std::to_string(found) + ": too large");
  }
  return int32_t(found);
}

double Arguments::real(int which) const {
  if (type_of(*values_[which]) == Type::whole) return double(whole(which));
  return real_of(typed(which, Type::real));
}

std::string Arguments::text(int which) const { return text_of(typed(which, Type::text)); }

void Arguments::vector(int which, double out[3]) const {
  float numbers[3];
  read_vector(typed(which, Type::vector), numbers);
  std::copy(numbers, numbers + 3, out);
}

std::vector<uint8_t> Arguments::bytes(int which) const { return bytes_of(typed(which, Type::bytes)); }

std::vector<int32_t> Arguments::whole_numbers(int which) const {
  return whole_numbers_of(typed(which, Type::whole_numbers));
}

ts_pose Arguments::pose(int which) const {
  float numbers[12];
  read_transform(typed(which, Type::transform), numbers);
  const std::string here = "argument " + std::to_string(which + 1) + " is a " + type_name(Type::transform);
  double m[3][3];
  for (int c = 0; c < 3; ++c) {
    const double length = std::hypot(numbers[c], numbers[3 + c], numbers[6 + c]);
    if (!(length > 1e-6)) throw Refused(here + " without size");
    for (int r = 0; r < 3; ++r) m[r][c] = numbers[3 * r + c] / length;
  }
  const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  if (!(std::fabs(determinant - 1.0) < 1e-3)) throw Refused(here + " that mirrors, shears or is not finite");
  ts_pose pose;
  std::copy(numbers + 9, numbers + 12, pose.position);
  // Compute the largest component of the quaternion first, because the other components are divided by it.
  const double trace = m[0][0] + m[1][1] + m[2][2];
  double* q = pose.rotation;
  if (trace > 0.0) {
    const double s = 2.0 * std::sqrt(trace + 1.0);
    q[0] = (m[2][1] - m[1][2]) / s, q[1] = (m[0][2] - m[2][0]) / s, q[2] = (m[1][0] - m[0][1]) / s, q[3] = s / 4.0;
  } else {
    const int i = m[0][0] >= m[1][1] && m[0][0] >= m[2][2] ? 0 : (m[1][1] >= m[2][2] ? 1 : 2);
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2.0 * std::sqrt(1.0 + m[i][i] - m[j][j] - m[k][k]);
    q[i] = s / 4.0, q[j] = (m[j][i] + m[i][j]) / s, q[k] = (m[k][i] + m[i][k]) / s, q[3] = (m[k][j] - m[j][k]) / s;
  }
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; ++i) q[i] /= length;
  return pose;
}

}  // namespace taichi_soft_godot
