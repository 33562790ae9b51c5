// Converts between the engine's axes and unit of length and the library's: z up, right-handed, metres.
#pragma once

#include "rotations.hpp"

namespace taichi_soft {

class Axes {
 public:
  // `rows` is the matrix from the library's positions to the engine's. Each row has one nonzero number. The absolute
  // values of these numbers are equal.
  explicit Axes(const double* rows);

  Vector place_in(const double* host) const { return in(host, 1.0 / scale_); }
  void place_out(const Vector& ours, double* host) const { out(ours, scale_, host); }
  void normal_out(const Vector& ours, double* host) const { out(ours, 1.0, host); }
  Vector normal_in(const double* host) const { return in(host, 1.0); }
  // Converts axial vectors: angular velocities, and moments, which contain the square of the unit of length.
  Vector turn_in(const double* host) const { return in(host, handedness_); }
  void moment_out(const Vector& ours, double* host) const { out(ours, handedness_ * scale_ * scale_, host); }
  Quaternion rotation_in(const double* host) const {
    const Vector v = in(host, handedness_);
    return {v[0], v[1], v[2], host[3]};
  }
  void rotation_out(const Quaternion& ours, double* host) const {
    out({ours[0], ours[1], ours[2]}, handedness_, host);
    host[3] = ours[3];
  }
  double length_in(double host) const { return host / scale_; }
  double scale() const { return scale_; }
  bool are_left_handed() const { return handedness_ < 0; }
  // Converts positions or normals, 3 numbers per row, to the engine's axes. `ours` and `host` can be the same memory.
  void rows_out(const float* ours, size_t count, bool are_places, float* host) const;
  void rows_in(const float* host, size_t count, float* ours) const;

 private:
  Vector in(const double* host, double factor) const {
    Vector ours;
    for (int i = 0; i < 3; ++i) ours[from_[i]] = sign_[i] * host[i] * factor;
    return ours;
  }
  void out(const Vector& ours, double factor, double* host) const {
    for (int i = 0; i < 3; ++i) host[i] = sign_[i] * ours[from_[i]] * factor;
  }

  int from_[3];  // the library's axis for each axis of the engine
  double sign_[3];
  double scale_;
  double handedness_;  // -1 if the engine's axes are left-handed
  bool are_ours_;
};

}  // namespace taichi_soft
