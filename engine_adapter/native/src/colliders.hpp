// Where colliders are and how they move: as taichi_soft/contact/colliders.py has it, number by number.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "archive.hpp"
#include "rotations.hpp"

namespace taichi_soft {

// Kinds of shapes with a grid, as taichi_soft/contact/distances/kinds.py has them, behind TS_PLANE to TS_CAPSULE.
enum { kHeightField = 4, kMeshShape = 5 };

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
  Pose target;   // at the end of the coming step
  Box bounds;    // in its own frame
  double skin;   // its thickness, and what its edges need
  int32_t kind;  // as in taichi_soft/contact/distances/kinds.py
  float parameters[8];
  double friction, restitution;  // the latter -1 for that of the bodies
  int32_t group, mask;
  uint32_t serial;  // who comes into the row later has another

  bool moves() const;
  // Round its way through `dt` [s], and its highest speed [m/s].
  Box way(double dt, double* fastest) const;
};

struct ColliderMotion {  // what the fields hold of one, for the coming step
  float position[3], rotation[4], velocity[3], spin[3], lower[3], upper[3], speed;
};

class Colliders {
 public:
  Colliders() = default;
  explicit Colliders(const Archive& archive);

  // Whether any may be elsewhere, or move otherwise, than in the step before; then `motion` is filled.
  bool prepare(double dt, std::vector<ColliderMotion>* motion);
  void finish(double dt);

  int32_t free_row() const;  // for a new collider: it may be one behind the last

  std::vector<Collider> rows;
  double seam = 0.0;     // skin of what has flat faces, beside its thickness [m]
  bool is_dirty = true;  // whether poses or velocities differ from what the fields hold
};

}  // namespace taichi_soft
