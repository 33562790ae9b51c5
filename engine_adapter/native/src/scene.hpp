// A world file in memory: data that all worlds of a scene share.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "archive.hpp"
#include "axes.hpp"
#include "constants.hpp"
#include "kernels.hpp"

namespace taichi_soft {

// Layout of a field. Element i starts at `offset + stride * i` [bytes] and has `width` numbers of 4 bytes.
struct Place {
  size_t offset, stride, count, width;
  bool is_whole;
};

struct Bound;

struct KeptField {  // a field in snapshots, and the number of its elements there
  enum { kAlways, kOfJoints, kOfMotors };
  Place place;
  size_t count;  // total; for kOfJoints per row of joints, for kOfMotors per particle of motors
  int whose;
  const Bound* bound;  // bounds of the field's numbers, or null
};

struct SlotRows {  // data that kernels write into a slot, see `body_rows` in taichi_soft/fracture/cutting.py
  Archive::View<float> rest, rest_inverses, edge_damping, kind, weights;
  Archive::View<int32_t> tet_vertices, tet_edges, edges, edge_blocks, triangles, outer;
  Archive::View<int32_t> touching_outer, touching_triangles, carriers;  // only if any asset has a hull
  Archive::View<int32_t> contact_edges, sharp_edges;                    // only if bodies touch each other
  std::vector<Archive::View<float>> constants;                          // constants of tetrahedra, by field
};

// Map from the vertices of one level of detail to the vertices of another, see taichi_soft/levels/passage.py.
struct Passage {
  Archive::View<int32_t> sources, begins;
  Archive::View<double> weights;
};

struct Asset {
  // Position, velocity, inverse mass, mass, and rounding error of the position of each vertex, (n, kRestWidth).
  Archive::View<float> rest_rows;
  Archive::View<double> vertices;  // positions at rest, (n, 3)
  Archive::View<double> masses;
  Vector center;
  Archive::View<int32_t> pinned, outer, rank, surface;
  Archive::View<int32_t> elements;  // vertices of each element: 2 for springs, 4 for tetrahedra
  Archive::View<double> element_stiffness;
  size_t element_width;
  Archive::View<int32_t> tets;
  Archive::View<int32_t> hull;  // four vertices per point of the hull; empty if contact uses the surface
  Archive::View<double> hull_weights;
  Archive::View<double> rigid;  // longest extent and radii of a rigid body, see RigidMesh; empty if it deforms
  double thickness, friction, wave_speed;
  int32_t group, mask;
  int32_t slot_count;
  // Levels of detail. With a single level, the following members are empty.
  SlotRows rows;
  std::vector<Asset> coarser;
  std::vector<Passage> passages;  // passage from level i to j at [i * level_count() + j]
  size_t vertex_count() const { return masses.count; }
  bool is_rigid() const { return rigid.count != 0; }
  size_t level_count() const { return 1 + coarser.size(); }
  const Asset& level(size_t number) const { return number == 0 ? *this : coarser[number - 1]; }
  const Passage& passage(size_t from, size_t to) const { return passages[from * level_count() + to]; }
};

struct Mesh {
  struct Table {  // input of the kernel
    bool is_serial;
    Archive::View<int32_t> ints;
    Archive::View<float> floats;
  };
  int32_t asset, level;  // a level of -1 means all levels of detail
  bool is_skin;
  size_t vertex_count;
  Archive::View<int32_t> triangles;
  Archive::View<float> uv;
  std::vector<Table> tables;  // one table, or one per level
  const Table& table(int32_t of_level) const { return tables[level < 0 ? size_t(of_level) : 0]; }
};

class Scene {
 public:
  explicit Scene(const std::string& folder);
  Scene(std::vector<char> world, const ts_linked_kernel* kernels);

  const std::vector<std::string>& names(int32_t kind) const;  // names of objects of a kind such as TS_BODY
  // Fails if the field is missing, has fewer than `count` elements, or fewer than `width` numbers per element.
  Place place(const std::string& field, size_t count = 0, size_t width = 1) const;

  Kernels::Kernel kernel(const std::string& name) const;

  Archive archive;
  Axes axes;
  bool sleeps, has_soft_contact, is_implicit, has_rods;
  int32_t slot_count, particle_count;
  double stable_share, stable_step;  // see `Substeps.rule`
  bool has_floor;
  double floor;
  int32_t floor_collider;  // collider of the floor, or -1
  double position_limit, velocity_limit, spin_limit, impulse_limit, push_limit, shortest_step, longest_step;
  double pull_in_weights, highest_pull_speed;  // for grabs: default force per mass [N/kg], highest speed [m/s]
  Archive::View<double> patch_limits;          // limits that the kernel shape_patch receives
  size_t patch_rows;
  std::vector<Asset> assets;
  std::vector<int32_t> asset_of_slot, begin_of_slot;
  bool has_levels = false, has_hulls = false;  // true if any asset has levels of detail, or a hull
  std::vector<std::string> constant_names;     // names of fields with constants of tetrahedra
  std::vector<Mesh> meshes;
  std::vector<KeptField> kept;
  uint32_t code = 0;  // equal for scenes whose snapshots are compatible

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
