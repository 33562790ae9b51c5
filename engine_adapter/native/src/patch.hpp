// The part of a body that a grab holds, bit-identical to taichi_soft/control/grab_patch.py.
#pragma once

#include <vector>

#include "scene.hpp"

namespace taichi_soft {

struct Patch {
  std::vector<int32_t> vertices;
  std::vector<double> shares;  // weights of the force, with sum 1
  double strength;             // largest force on the patch [N]
};

// Patch around a rest point between `count` vertices, three or four.
Patch patch_around(const Scene& scene, const Asset& asset, const int32_t* corners, const double* weights, size_t count);

}  // namespace taichi_soft
