// Coordinates in float64 as two floats: the rounded coordinate and its rounding error.
#pragma once

#include <cmath>

#include "constants.hpp"

namespace taichi_soft {

// Returns the error, or 0 where adding it, itself rounded, would change `x`: see `residue_of` in
// taichi_soft/bodies/kernels/origins.py.
inline float residue_of(float x, float residue) { return x + residue == x ? residue : 0.0f; }

// Splits a coordinate. The error is omitted near the origin: see `_split` in taichi_soft/control/frames.py.
inline void split(double place, float* x, float* residue) {
  *x = static_cast<float>(place);
  *residue = std::fabs(place) > kNear ? static_cast<float>(place - double(*x)) : 0.0f;
}

}  // namespace taichi_soft
