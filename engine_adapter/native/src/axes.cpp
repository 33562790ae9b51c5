#include "axes.hpp"

#include <cstring>

#include "error.hpp"

namespace taichi_soft {

Axes::Axes(const double* rows) : scale_(0.0) {
  bool is_taken[3] = {};
  are_ours_ = true;
  for (int i = 0; i < 3; ++i) {
    from_[i] = -1;
    for (int k = 0; k < 3; ++k) {
      const double number = rows[3 * i + k];
      if (number == 0.0) continue;
      const double size = std::fabs(number);
      if (from_[i] >= 0 || is_taken[k] || !(size <= 1e6) || (i > 0 && size != scale_)) from_[i] = 3;
      if (from_[i] == 3) break;
      is_taken[k] = true;
      from_[i] = k;
      sign_[i] = number > 0 ? 1.0 : -1.0;
      scale_ = size;
    }
    if (from_[i] < 0 || from_[i] > 2) fail(TS_ERROR_FILE, "the world file has invalid axes: export it again");
    are_ours_ = are_ours_ && from_[i] == i && sign_[i] > 0;
  }
  const bool is_even = (from_[1] - from_[0] + 3) % 3 == 1;
  handedness_ = (is_even ? 1.0 : -1.0) * sign_[0] * sign_[1] * sign_[2];
  are_ours_ = are_ours_ && scale_ == 1.0;
}

void Axes::rows_out(const float* ours, size_t count, bool are_places, float* host) const {
  if (are_ours_) {
    if (ours != host) std::memcpy(host, ours, count * 3 * sizeof(float));
    return;
  }
  const float factor = are_places ? static_cast<float>(scale_) : 1.0f;
  for (size_t row = 0; row < count; ++row) {
    const float from[3] = {ours[3 * row], ours[3 * row + 1], ours[3 * row + 2]};
    for (int i = 0; i < 3; ++i) host[3 * row + i] = static_cast<float>(sign_[i]) * factor * from[from_[i]];
  }
}

void Axes::rows_in(const float* host, size_t count, float* ours) const {
  for (size_t row = 0; row < count; ++row) {
    const double from[3] = {host[3 * row], host[3 * row + 1], host[3 * row + 2]};
    const Vector found = place_in(from);
    for (int i = 0; i < 3; ++i) ours[3 * row + i] = static_cast<float>(found[i]);
  }
}

}  // namespace taichi_soft
