// Poses and motion of colliders, bit-identical to taichi_soft/contact/colliders.py.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "archive.hpp"
#include "constants.hpp"
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
  Pose target;   // pose at the end of the next step
  Box bounds;    // bounding box in the frame of the shape
  double skin;   // thickness plus a margin for edges
  int32_t kind;  // number from taichi_soft/contact/distances/shape_kind.py
  float parameters[8];
  double friction, restitution;  // with a restitution of -1, the bodies' restitution is used
  int32_t group, mask;
  Vector surface_velocity;  // relative to the collider, in its frame
  bool is_sensor;           // true if bodies do not touch the collider
  uint32_t serial;          // distinguishes successive colliders in the same row

  bool moves() const;
  // Box around the collider's path during `dt` [s]. `fastest` receives the collider's highest speed [m/s].
  Box way(double dt, double* fastest) const;
};

struct ColliderMotion {  // field values of a collider for the next step
  float position[3], rotation[4], velocity[3], spin[3], lower[3], upper[3], speed, residue[3];
};

class Colliders {
 public:
  Colliders() = default;
  explicit Colliders(const Archive& archive);

  // Fills `motion`. Returns: true if the pose or motion of any collider may differ from the previous step.
  bool prepare(double dt, std::vector<ColliderMotion>* motion);
  void finish(double dt);

  int32_t free_row() const;  // index of a row for a new collider, which may have to be appended

  std::vector<Collider> rows;
  double seam = 0.0;     // additional skin of shapes with flat faces [m]
  bool is_dirty = true;  // true if poses or velocities have changed since they were written to the fields
};

}  // namespace taichi_soft
