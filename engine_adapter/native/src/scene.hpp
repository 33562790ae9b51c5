// A world file in memory: all that the worlds made of it share.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "archive.hpp"
#include "axes.hpp"
#include "kernels.hpp"

namespace taichi_soft {

// Where a field lies: element i begins `stride` i bytes behind `offset`, and has `width` numbers of 4 bytes.
struct Place {
  size_t offset, stride, count, width;
  bool is_whole;
};

struct Carried {  // a field that snapshots have, and how many of its elements
  enum { kAlways, kOfJoints, kOfMotors };
  Place place;
  size_t count;    // for each row that joints or motors hold, if it is one of theirs
  int whose;
  bool is_finite;  // it moves bodies
};

constexpr size_t kLanes = 8;  // as taichi_soft/core/constants.py has it

struct SlotRows {  // what kernels write into a slot: see `body_rows` in taichi_soft/fracture/cutting.py
  Archive::View<float> rest, rest_inverses, edge_damping, kind, weights;
  Archive::View<int32_t> tet_vertices, tet_edges, edges, edge_blocks, triangles, outer;
  Archive::View<int32_t> touching_outer, touching_triangles, carriers;  // where anything has a hull
  std::vector<Archive::View<float>> constants;                          // of tetrahedra, by field
};

// From the vertices of one level of detail to those of another: see taichi_soft/levels/passage.py.
struct Passage {
  Archive::View<int32_t> sources, begins;
  Archive::View<double> weights;
};

struct Asset {
  Archive::View<float> rest_rows;  // (n, 8) position, velocity, inverse mass, mass of each vertex
  Archive::View<double> vertices;  // (n, 3)
  Archive::View<double> masses;
  Vector center;
  Archive::View<int32_t> pinned, outer, rank, surface;
  Archive::View<int32_t> elements;  // vertices of each: 2 of springs, 4 of tetrahedra
  Archive::View<double> element_stiffness;
  size_t element_width;
  Archive::View<int32_t> tets;
  Archive::View<int32_t> hull;  // four vertices of each point of its hull; none where it touches by its surface
  Archive::View<double> hull_weights;
  double thickness, friction, wave_speed;
  int32_t slot_count;
  // Levels of detail. What follows is empty where there is only one.
  SlotRows rows;
  std::vector<Asset> coarser;
  std::vector<Passage> passages;  // from level i to j at [i * level_count() + j]
  size_t vertex_count() const { return masses.count; }
  size_t level_count() const { return 1 + coarser.size(); }
  const Asset& level(size_t number) const { return number == 0 ? *this : coarser[number - 1]; }
  const Passage& passage(size_t from, size_t to) const { return passages[from * level_count() + to]; }
};

struct Mesh {
  struct Table {  // what the kernel reads
    bool is_serial;
    Archive::View<int32_t> ints;
    Archive::View<float> floats;
  };
  int32_t asset, level;  // the latter -1 where it is drawn at every level of detail
  bool is_skin;
  size_t vertex_count;
  Archive::View<int32_t> triangles;
  Archive::View<float> uv;
  std::vector<Table> tables;  // one, or one for each level
  const Table& table(int32_t of_level) const { return tables[level < 0 ? size_t(of_level) : 0]; }
};

class Scene {
 public:
  explicit Scene(const std::string& folder);
  Scene(std::vector<char> world, const ts_linked_kernel* kernels);

  const std::vector<std::string>& names(int32_t kind) const;  // of TS_BODY and so on
  // Fails where the field is missing, or has fewer elements or numbers in each.
  Place place(const std::string& field, size_t count = 0, size_t width = 1) const;

  Kernels::Kernel kernel(const std::string& name) const;

  Archive archive;
  Axes axes;
  bool has_contact, sleeps, has_soft_contact, is_implicit;
  int32_t slot_count, particle_count;
  double stable_share, stable_step;  // see `Substeps.rule`
  bool has_floor;
  double floor;
  int32_t floor_collider;  // the floor, where there are colliders; -1 where it is none
  double position_limit, velocity_limit, spin_limit, impulse_limit, push_limit, shortest_step, longest_step;
  double pull_in_weights, highest_pull_speed;  // of grabs; the first in N/kg
  Archive::View<double> patch_limits;          // that the kernel shape_patch takes
  size_t patch_rows;
  std::vector<Asset> assets;
  std::vector<int32_t> asset_of_slot, begin_of_slot;
  bool has_levels = false, has_hulls = false;  // whether any asset has levels of detail, or a hull
  std::vector<std::string> constant_names;  // fields with constants of tetrahedra
  std::vector<Mesh> meshes;
  std::vector<Carried> carried;
  uint32_t code = 0;  // of what a snapshot fits into

 private:
  Scene(std::vector<char> world, const std::string& name);
  void take(std::unique_ptr<Kernels> kernels);
  void read_assets();
  Asset read_asset(const std::string& prefix) const;
  SlotRows read_slot_rows(const std::string& prefix, const Asset& asset, size_t most) const;
  void read_levels(const std::string& prefix, int32_t count, Asset* asset) const;
  void read_meshes();
  void read_fields();

  std::vector<std::string> names_[7];
  std::vector<std::string> field_names_;
  std::vector<Place> places_;
  std::unique_ptr<Kernels> code_;
  std::map<std::string, Kernels::Kernel> kernels_;
};

}  // namespace taichi_soft
