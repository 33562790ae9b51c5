#include "patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "barycentric.hpp"

namespace taichi_soft {

namespace {

// Stiffness [N/m] against moving each vertex by its falloff.
double stiffness(const Asset& asset, const std::vector<double>& falloff) {
  const size_t width = asset.element_width;
  double total = 0.0;
  for (size_t e = 0; e < asset.element_stiffness.count; ++e) {
    const int32_t* row = asset.elements.data + width * e;
    bool is_near = false;
    for (size_t i = 0; i < width; ++i) is_near = is_near || falloff[size_t(row[i])] != 0.0;
    if (!is_near) continue;
    Vector rise = {0.0, 0.0, 0.0};
    for (size_t i = 1; i < width; ++i) rise[i - 1] = falloff[size_t(row[i])] - falloff[size_t(row[0])];
    double square = rise[0] * rise[0];
    if (width == 4) {
      Vector edge[3];
      for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
          edge[i][k] = asset.vertices[size_t(3 * row[i + 1] + k)] - asset.vertices[size_t(3 * row[0] + k)];
        }
      }
      const Vector across[3] = {cross(edge[1], edge[2]), cross(edge[2], edge[0]), cross(edge[0], edge[1])};
      const double volume = dot(edge[0], across[0]);
      Vector slope;
      for (int k = 0; k < 3; ++k) slope[k] = dot(rise, {across[0][k], across[1][k], across[2][k]}) / volume;
      square = dot(slope, slope);
    }
    total += asset.element_stiffness[e] * square;
  }
  return total;
}

}  // namespace

Patch patch_around(const Scene& scene, const Asset& asset, const int32_t* corners, const double* weights,
                  size_t count) {
  const size_t n = asset.vertex_count(), most = scene.patch_rows;
  Vector point = {0.0, 0.0, 0.0}, size;
  for (int k = 0; k < 3; ++k) {
    for (size_t i = 0; i < count; ++i) point[k] += weights[i] * asset.vertices[size_t(3 * corners[i] + k)];
    double least = std::numeric_limits<double>::infinity(), greatest = -least;
    for (size_t v = 0; v < n; ++v) {
      least = std::min(least, asset.vertices[3 * v + k]);
      greatest = std::max(greatest, asset.vertices[3 * v + k]);
    }
    size[k] = greatest - least;
  }
  std::vector<double> distance(n);
  for (size_t v = 0; v < n; ++v) {
    Vector way;
    for (int k = 0; k < 3; ++k) way[k] = asset.vertices[3 * v + k] - point[k];
    distance[v] = std::sqrt(dot(way, way));
  }
  double farthest = 0.0;
  for (size_t i = 0; i < count; ++i) farthest = std::max(farthest, distance[size_t(corners[i])]);
  double radius = std::max(scene.patch_size * length_of(size), 1.2 * farthest);
  if (size_t(std::count_if(distance.begin(), distance.end(), [&](double d) { return d < radius; })) > most) {
    std::vector<double> sorted = distance;
    std::nth_element(sorted.begin(), sorted.begin() + long(most), sorted.end());
    radius = sorted[most];
  }
  Patch found;
  std::vector<double> falloff(n);
  double total = 0.0;
  for (size_t v = 0; v < n; ++v) {
    const double part = distance[v] / radius, left = std::max(1.0 - part * part, 0.0);
    falloff[v] = left * left;
    if (!(falloff[v] >= 1e-6)) falloff[v] = 0.0;  // also NaN, which would exceed the capacity
    if (falloff[v] == 0.0) continue;
    found.vertices.push_back(int32_t(v));
    found.shares.push_back(falloff[v] * asset.masses[v]);
    total += found.shares.back();
  }
  for (double& each : found.shares) each = each / total;
  found.strength = scene.farthest_pull * radius * stiffness(asset, falloff);
  return found;
}

}  // namespace taichi_soft
