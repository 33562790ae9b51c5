// The part of a body that a hand takes hold of: as taichi_soft/control/grab_patch.py has it, sum by sum.
#pragma once

#include <vector>

#include "scene.hpp"

namespace taichi_soft {

struct Patch {
  std::vector<int32_t> vertices;
  std::vector<double> shares;  // of a pull; they add up to 1
  double strength;             // [N], up to which it is pulled on the patch
};

// Round a point at rest between `count` vertices, three or four.
Patch patch_round(const Scene& scene, const Asset& asset, const int32_t* corners, const double* weights, size_t count);

}  // namespace taichi_soft
