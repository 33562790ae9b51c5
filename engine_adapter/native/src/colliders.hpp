// Poses and motion of colliders, bit-identical to taichi_soft/contact/colliders.py.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "constants.hpp"
#include "archive.hpp"
#include "rotations.hpp"

namespace taichi_soft {


struct Pose {
  Vector position;
  Quaternion rotation;
};

struct Box {
  Vector lower, upper;
};

struct Collider {
  bool is_alive;
  Pose pose;
  Vector velocity, spin;
  bool has_target;
  Pose target;   // at the end of the next step
  Box bounds;    // in its own frame
  double skin;   // thickness, plus the margin for edges
  int32_t kind;  // as in taichi_soft/contact/distances/shape_kind.py
  float parameters[8];
  double friction, restitution;  // a restitution of -1 uses that of the bodies
  int32_t group, mask;
  uint32_t serial;  // differs for each collider in the row

  bool moves() const;
  // Box around its path during `dt` [s], and its highest speed [m/s].
  Box way(double dt, double* fastest) const;
};

struct ColliderMotion {  // field values of a collider for the next step
  float position[3], rotation[4], velocity[3], spin[3], lower[3], upper[3], speed;
};

class Colliders {
 public:
  Colliders() = default;
  explicit Colliders(const Archive& archive);

  // Fills `motion` and returns true if the pose or motion of any collider may differ from the previous step.
  bool prepare(double dt, std::vector<ColliderMotion>* motion);
  void finish(double dt);

  int32_t free_row() const;  // for a new collider; can be one after the last row

  std::vector<Collider> rows;
  double seam = 0.0;     // additional skin of shapes with flat faces [m]
  bool is_dirty = true;  // true if poses or velocities differ from the fields
};

}  // namespace taichi_soft
