#include "scene.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "error.hpp"
#include "fields.hpp"

namespace taichi_soft {

namespace {

[[noreturn]] void invalid_file(const char* what) {
  fail(TS_ERROR_FILE, "the world file is invalid: %s. Export it again", what);
}

// True if all numbers are below the limit for positions.
bool are_places(const Archive::View<double>& numbers) {
  for (double number : numbers) {
    if (!(std::fabs(number) <= 1e30)) return false;
  }
  return true;
}

bool are_below(const Archive::View<int32_t>& numbers, size_t limit) {
  for (int32_t number : numbers) {
    if (number < 0 || static_cast<size_t>(number) >= limit) return false;
  }
  return true;
}

Place place_from(const int64_t* row, size_t image) {
  for (int k = 0; k < 5; ++k) {
    if (row[k] < 0 || static_cast<uint64_t>(row[k]) > image) invalid_file("a field");
  }
  const Place found = {size_t(row[0]), size_t(row[1]), size_t(row[2]), size_t(row[3]), row[4] == 1};
  if (found.count > 0 && found.offset + (found.count - 1) * found.stride + 4 * found.width > image) {
    invalid_file("a field outside the image");
  }
  return found;
}

// True if all indices of a surface's table are in range: see `render_table` in taichi_soft/bodies/render_mesh.py.
bool is_surface_valid(const Mesh::Table& mesh, size_t k, size_t body_vertices) {
  constexpr size_t kStride = 10 * kLanes;
  const size_t blocks = (k + kLanes - 1) / kLanes, head = blocks * kStride + k;
  if (k == 0 || mesh.ints.count < head + blocks + 2) return false;
  for (size_t i = 0; i < head; ++i) {
    const size_t limit = i < blocks * kStride ? k : body_vertices;
    if (mesh.ints[i] < 0 || size_t(mesh.ints[i]) >= limit) return false;
  }
  size_t before = head + blocks + 2;  // after the number of blocks with small rings, which needs no check
  for (size_t block = 0; block <= blocks; ++block) {
    const int32_t begin = mesh.ints[head + block];
    if (begin < 0 || size_t(begin) < before || size_t(begin) > mesh.ints.count) return false;
    before = size_t(begin);
  }
  for (size_t i = head + blocks + 2; i + 3 <= mesh.ints.count; i += 3) {
    const int32_t* row = mesh.ints.data + i;
    if (row[0] < 0 || row[0] >= int32_t(kLanes) || row[1] < 0 || size_t(row[1]) >= k || row[2] < 0 ||
        size_t(row[2]) >= k) {
      return false;
    }
  }
  return true;
}

// True if all indices of a skin's table are in range: see `write_skin` in taichi_soft/bodies/kernels/skin.py.
bool is_skin_valid(const Mesh::Table& mesh, size_t k, size_t n) {
  constexpr size_t kSkinLanes = 16, kRow = 10;
  const size_t blocks = (k + kSkinLanes - 1) / kSkinLanes;
  if (k == 0 || mesh.ints.count < n + 1 || mesh.ints[n] < 0) return false;
  const size_t edges = size_t(mesh.ints[n]);
  if (mesh.ints.count != n + 1 + edges + 4 * kSkinLanes * blocks) return false;
  if (mesh.floats.count != 3 * (edges + n) + kRow * kSkinLanes * blocks) return false;
  int32_t before = 0;
  for (size_t v = 0; v <= n; ++v) {
    if (mesh.ints[v] < before || size_t(mesh.ints[v]) > edges) return false;
    before = mesh.ints[v];
  }
  for (size_t i = n + 1; i < mesh.ints.count; ++i) {
    if (mesh.ints[i] < 0 || size_t(mesh.ints[i]) >= n) return false;
  }
  return true;
}

const char* const kKinds[] = {"names/body", "names/asset", "names/collider", "names/frame",
                              "names/mesh", "names/joint", "names/motor"};

}  // namespace

Scene::Scene(std::vector<char> world, const ts_linked_kernel* kernels) : Scene(std::move(world), "world") {
  take(std::make_unique<Kernels>(kernels));
}

void Scene::take(std::unique_ptr<Kernels> kernels) {
  code_ = std::move(kernels);
  const auto stamp = archive.texts("kernels/stamp");
  if (stamp.size() != 1 || code_->stamp() == nullptr || stamp[0] != code_->stamp()) {
    fail(TS_ERROR_FILE, "the kernels belong to another export: export the world again, and ship both");
  }
  for (const std::string& name : archive.texts("kernels/names")) kernels_[name] = code_->find(name);
}

Scene::Scene(std::vector<char> world, const std::string& name)
    : archive(std::move(world), name),
      axes(archive.rows<double>("host_axes", 3).count == 9 ? archive.get<double>("host_axes").data
                                                           : (invalid_file("axes"), nullptr)) {
  for (int kind = 0; kind < 7; ++kind) names_[kind] = archive.texts(kKinds[kind]);
  const auto flags = archive.get<int32_t>("world/flags"), counts = archive.get<int32_t>("world/counts");
  const auto stable = archive.get<double>("world/stable"), limits = archive.get<double>("world/limits");
  const auto floors = archive.get<double>("world/floor");
  const auto assets_of = archive.get<int32_t>("slots/asset"), begins = archive.get<int32_t>("slots/begin");
  const auto grabs = archive.get<double>("grabs/limits");
  if (flags.count != 4 || grabs.count != 3 || counts.count != 2 || stable.count != 2 || limits.count != 7)
    invalid_file("numbers");
  sleeps = flags[0] != 0;
  has_soft_contact = flags[1] != 0;
  is_implicit = flags[2] != 0;
  has_rods = flags[3] != 0;
  patch_limits = archive.get<double>("grabs/patch_limits");
  if (patch_limits.count != 4) invalid_file("numbers");
  pull_in_weights = grabs[0], highest_pull_speed = grabs[1];
  for (const auto& numbers : {grabs, patch_limits}) {
    for (double each : numbers) {
      if (!(each >= 0.0 && each <= 1e30)) invalid_file("grabs");
    }
  }
  patch_rows = grabs[2] >= 1.0 && grabs[2] <= 1e6 ? size_t(grabs[2]) : 0;
  slot_count = counts[0], particle_count = counts[1];
  stable_share = stable[0], stable_step = stable[1];
  has_floor = floors.count == 1;
  floor = has_floor ? floors[0] : 0.0;
  const auto floor_colliders = archive.get<int32_t>("world/floor_collider");
  if (floor_colliders.count != 1) invalid_file("the floor");
  floor_collider = floor_colliders[0];
  position_limit = limits[0], velocity_limit = limits[1], spin_limit = limits[2];
  impulse_limit = limits[3], push_limit = limits[4];
  shortest_step = limits[5], longest_step = limits[6];
  asset_of_slot.assign(assets_of.begin(), assets_of.end());
  begin_of_slot.assign(begins.begin(), begins.end());
  if (slot_count < 1 || size_t(slot_count) != asset_of_slot.size() || size_t(slot_count) != begin_of_slot.size() ||
      size_t(slot_count) != names_[TS_BODY].size() || particle_count < 1 || particle_count > (1 << 28)) {
    invalid_file("slots");
  }
  read_fields();
  read_assets();
  read_meshes();
  // `code` does not change if the same scene is exported again, so that snapshots remain valid.
  for (const char* name : {"fields/kept", "fields/places"}) {
    const auto rows = archive.get<int64_t>(name);
    code = code * 31 + checksum(reinterpret_cast<const char*>(rows.data), rows.count * sizeof(int64_t));
  }
  for (const Asset& asset : assets) {
    for (size_t level = 0; level < asset.level_count(); ++level) {
      const Archive::View<float>& rows = asset.level(level).rest_rows;
      code = code * 31 + checksum(reinterpret_cast<const char*>(rows.data), rows.count * sizeof(float));
    }
  }
}

void Scene::read_fields() {
  field_names_ = archive.texts("fields/names");
  const auto rows = archive.rows<int64_t>("fields/places", 5);
  const size_t image = archive.get<unsigned char>("fields/image").count;
  if (rows.count != 5 * field_names_.size()) invalid_file("fields");
  for (size_t i = 0; i < field_names_.size(); ++i) places_.push_back(place_from(rows.data + 5 * i, image));
  std::map<size_t, const Bound*> bounds;  // bounds by the address of their field
  for (const Bound& each : kBounds) {
    const auto name = std::find(field_names_.begin(), field_names_.end(), each.field);
    if (name != field_names_.end()) bounds[places_[size_t(name - field_names_.begin())].offset] = &each;
  }
  const auto rows_kept = archive.rows<int64_t>("fields/kept", 7);
  for (size_t i = 0; i + 7 <= rows_kept.count; i += 7) {
    const int64_t* row = rows_kept.data + i;
    KeptField each = {place_from(row, image), size_t(row[5]), int(row[6]), nullptr};
    if (row[5] < 0 || each.whose < KeptField::kAlways || each.whose > KeptField::kOfMotors ||
        each.count > each.place.count) {
      invalid_file("the fields of snapshots");
    }
    const auto bound = bounds.find(each.place.offset);
    if (bound != bounds.end()) each.bound = bound->second;
    kept.push_back(each);
  }
}

Asset Scene::read_asset(const std::string& prefix) const {
  Asset asset = {archive.rows<float>(prefix + "rest_rows", kRestWidth),
                 archive.rows<double>(prefix + "vertices", 3),
                 archive.get<double>(prefix + "masses"),
                 {},
                 archive.get<int32_t>(prefix + "pinned"),
                 archive.get<int32_t>(prefix + "outer"),
                 archive.get<int32_t>(prefix + "rank"),
                 archive.rows<int32_t>(prefix + "surface", 3),
                 archive.get<int32_t>(prefix + "elements"),
                 archive.get<double>(prefix + "element_stiffness"),
                 0,
                 archive.get<int32_t>(prefix + "tets"),
                 archive.get<int32_t>(prefix + "hull"),
                 archive.get<double>(prefix + "hull_weights"),
                 archive.get<double>(prefix + "rigid"),
                 0.0,
                 0.0,
                 0.0,
                 0,
                 0,
                 0,
                 {},
                 {},
                 {}};
  const auto center = archive.get<double>(prefix + "center"), skin = archive.get<double>(prefix + "thickness");
  const auto wave_speed = archive.get<double>(prefix + "wave_speed");
  const auto friction = archive.get<double>(prefix + "friction");
  const auto filter = archive.get<int32_t>(prefix + "filter");
  const size_t n = asset.vertex_count();
  if (asset.rest_rows.count != kRestWidth * n || asset.vertices.count != 3 * n || asset.rank.count != n ||
      center.count != 3 || skin.count != 1 || friction.count != 1 || filter.count != 2 || wave_speed.count != 1 ||
      asset.tets.count % 4 != 0 || !are_below(asset.tets, n) || asset.hull.count % 4 != 0 ||
      !are_below(asset.hull, n) || asset.hull_weights.count != asset.hull.count || !are_places(asset.vertices) ||
      asset.elements.sizes.size() != 2 || !are_below(asset.elements, n) || !are_below(asset.pinned, n) ||
      !are_below(asset.outer, n) || !are_below(asset.rank, n) ||
      !are_below(asset.surface, asset.is_rigid() ? asset.hull.count / 4 : n)) {
    invalid_file("an asset");
  }
  asset.element_width = asset.elements.sizes[1];
  if ((asset.element_width != 2 && asset.element_width != 4) ||
      asset.elements.sizes[0] != asset.element_stiffness.count) {
    invalid_file("an asset");
  }
  if (asset.is_rigid() && (asset.rigid.count != 4 || n != 4 || asset.tets.count + asset.elements.count < 4 ||
                           !(*std::min_element(asset.rigid.begin(), asset.rigid.end()) > 0.0))) {
    invalid_file("an asset");
  }
  asset.center = {center[0], center[1], center[2]};
  asset.thickness = skin[0], asset.friction = friction[0], asset.wave_speed = wave_speed[0];
  asset.group = filter[0], asset.mask = filter[1];
  if (asset.element_width == 4) asset.tets = asset.elements;
  return asset;
}

// Reads the rows of one level. The first world of the scene checks that the rows fit the slots.
SlotRows Scene::read_slot_rows(const std::string& prefix, const Asset& asset, size_t most) const {
  constexpr size_t kCornerRows = 4 * kLanes, kEdgeRows = 6 * kLanes;
  const std::string slot = prefix + "slot/", touching = prefix + "touching/";
  SlotRows rows{};
  rows.rest = archive.rows<float>(slot + "rest", 3);
  rows.rest_inverses = archive.get<float>(slot + "rest_inverses");
  rows.edge_damping = archive.get<float>(slot + "edge_damping");
  rows.kind = archive.get<float>(slot + "kind");
  rows.tet_vertices = archive.get<int32_t>(slot + "tet_vertices");
  rows.tet_edges = archive.get<int32_t>(slot + "tet_edges");
  rows.edges = archive.rows<int32_t>(slot + "edges", 2);
  rows.edge_blocks = archive.rows<int32_t>(slot + "edge_blocks", 2);
  rows.triangles = archive.rows<int32_t>(slot + "triangles", 3);
  rows.outer = archive.get<int32_t>(slot + "outer");
  const size_t n = asset.vertex_count(), edges = rows.edges.count / 2, blocks = rows.tet_vertices.count / kCornerRows;
  if (rows.rest.count != 3 * n || rows.tet_vertices.count != kCornerRows * blocks ||
      rows.tet_edges.count != kEdgeRows * blocks || rows.rest_inverses.count != 2 * 9 * kLanes * blocks ||
      rows.edge_damping.count != edges || edges < kLanes || rows.kind.count != 7 || !are_below(rows.tet_vertices, n) ||
      !are_below(rows.tet_edges, edges) || !are_below(rows.edges, n) || !are_below(rows.triangles, n) ||
      !are_below(rows.outer, n)) {
    invalid_file("a level of detail");
  }
  for (size_t i = 0; i < rows.edge_blocks.count; i += 2) {
    const int32_t first = rows.edge_blocks[i], count = rows.edge_blocks[i + 1];
    if (first < 0 || count < 0 || count > int32_t(kLanes) || size_t(first) + kLanes > edges) {
      invalid_file("a level of detail");
    }
  }
  for (const std::string& name : constant_names) {
    rows.constants.push_back(archive.get<float>(prefix + "constants/" + name));
    if (blocks == 0 || rows.constants.back().count % (kLanes * blocks) != 0) invalid_file("a level of detail");
  }
  const size_t points = most + asset.hull.count / 4;  // the points of a hull come after the slot's particles
  if (has_soft_contact) {
    rows.contact_edges = archive.rows<int32_t>(touching + "edges", 4);
    rows.sharp_edges = archive.get<int32_t>(touching + "sharp");
    if (rows.sharp_edges.count != 1 || rows.sharp_edges[0] < 0 ||
        size_t(rows.sharp_edges[0]) > rows.contact_edges.count / 4) {
      invalid_file("a level of detail");
    }
    for (size_t i = 0; i < rows.contact_edges.count; ++i) {
      const int32_t point = rows.contact_edges[i];
      const bool may_be_absent = i % 4 >= 2;  // opposite corners of the edges of sheets and ropes
      if (point < (may_be_absent ? -2 : 0) || (point >= 0 && size_t(point) >= points)) {
        invalid_file("a level of detail");
      }
    }
  }
  if (!has_hulls) return rows;
  rows.touching_outer = archive.get<int32_t>(touching + "outer");
  rows.touching_triangles = archive.rows<int32_t>(touching + "triangles", 3);
  rows.carriers = archive.rows<int32_t>(touching + "carriers", 4);
  rows.weights = archive.rows<float>(touching + "weights", 4);
  if (rows.carriers.count != rows.weights.count || rows.carriers.count != asset.hull.count ||
      !are_below(rows.carriers, n) || !are_below(rows.touching_outer, points) ||
      !are_below(rows.touching_triangles, points)) {
    invalid_file("a level of detail");
  }
  return rows;
}

void Scene::read_levels(const std::string& prefix, int32_t count, Asset* asset) const {
  asset->rows = read_slot_rows(prefix, *asset, asset->vertex_count());
  for (int32_t level = 1; level < count; ++level) {
    const std::string name = prefix + "level" + std::to_string(level) + "/";
    asset->coarser.push_back(read_asset(name));
    Asset& coarse = asset->coarser.back();
    coarse.rows = read_slot_rows(name, coarse, asset->vertex_count());
    const SlotRows &rows = coarse.rows, &room = asset->rows;
    if (coarse.vertex_count() > asset->vertex_count() || rows.tet_vertices.count > room.tet_vertices.count ||
        rows.edges.count > room.edges.count || rows.edge_blocks.count > room.edge_blocks.count ||
        rows.triangles.count > room.triangles.count || rows.outer.count > room.outer.count ||
        rows.touching_outer.count > std::max(room.touching_outer.count, room.outer.count) ||
        rows.touching_triangles.count > std::max(room.touching_triangles.count, room.triangles.count) ||
        coarse.hull.count != asset->hull.count) {
      invalid_file("a level of detail");
    }
  }
  for (size_t i = 0; i < asset->level_count() * asset->level_count(); ++i) {
    const size_t from = i / asset->level_count(), to = i % asset->level_count();
    asset->passages.emplace_back();
    if (from == to) continue;
    const std::string name = prefix + "passage" + std::to_string(from) + "-" + std::to_string(to) + "/";
    Passage& over = asset->passages.back();
    over.sources = archive.get<int32_t>(name + "sources");
    over.begins = archive.get<int32_t>(name + "begins");
    over.weights = archive.get<double>(name + "weights");
    bool is_whole = over.begins.count == asset->level(to).vertex_count() && over.begins.count > 0 &&
                    over.begins[0] == 0 && over.weights.count == over.sources.count && are_places(over.weights) &&
                    are_below(over.sources, asset->level(from).vertex_count());
    for (size_t k = 0; is_whole && k < over.begins.count; ++k) {
      const size_t end = k + 1 < over.begins.count ? size_t(over.begins[k + 1]) : over.sources.count;
      is_whole = over.begins[k] >= 0 && size_t(over.begins[k]) < end && end <= over.sources.count;
    }
    if (!is_whole) invalid_file("the transition between levels of detail");
  }
}

void Scene::read_assets() {
  const auto levels = archive.get<int32_t>("levels/counts");
  constant_names = archive.texts("levels/constants");
  has_hulls = std::find(field_names_.begin(), field_names_.end(), "hull.carriers") != field_names_.end();
  if (levels.count != names_[TS_ASSET].size()) invalid_file("levels of detail");
  for (size_t i = 0; i < levels.count; ++i) {
    const std::string prefix = "asset" + std::to_string(i) + "/";
    assets.push_back(read_asset(prefix));
    if (levels[i] < 1 || levels[i] > 1000) invalid_file("levels of detail");
    if (levels[i] == 1) continue;
    read_levels(prefix, levels[i], &assets.back());
    has_levels = true;
  }
  for (int32_t slot = 0; slot < slot_count; ++slot) {
    const int32_t asset = asset_of_slot[slot], begin = begin_of_slot[slot];
    if (asset < 0 || size_t(asset) >= assets.size() || begin < 0 ||
        size_t(begin) + assets[asset].vertex_count() > size_t(particle_count)) {
      invalid_file("a slot");
    }
    ++assets[asset].slot_count;
  }
}

void Scene::read_meshes() {
  for (size_t i = 0; i < names_[TS_MESH].size(); ++i) {
    const std::string prefix = "mesh" + std::to_string(i) + "/";
    const auto kind = archive.get<int32_t>(prefix + "kind"), is_serial = archive.get<int32_t>(prefix + "is_serial");
    if (kind.count != 4 || kind[0] < 0 || size_t(kind[0]) >= assets.size() || kind[3] < 0) invalid_file("a mesh");
    const Asset& asset = assets[size_t(kind[0])];
    Mesh mesh = {kind[0],
                 kind[1],
                 kind[2] != 0,
                 size_t(kind[3]),
                 archive.rows<int32_t>(prefix + "triangles", 3),
                 archive.get<float>(prefix + "uv"),
                 {}};
    const bool is_of_all = mesh.level == -1, has_uv = mesh.uv.count != 0;
    if (mesh.level < -1 || mesh.level >= int32_t(asset.level_count()) ||
        is_serial.count != (is_of_all ? asset.level_count() : 1) || !are_below(mesh.triangles, mesh.vertex_count) ||
        (has_uv && mesh.uv.count != 2 * mesh.vertex_count)) {
      invalid_file("a mesh");
    }
    for (size_t k = 0; k < is_serial.count; ++k) {
      const Mesh::Table table = {is_serial[k] != 0, archive.get<int32_t>(prefix + "ints" + std::to_string(k)),
                                 archive.get<float>(prefix + "floats" + std::to_string(k))};
      const size_t n = asset.level(is_of_all ? k : size_t(mesh.level)).vertex_count();
      if (!(mesh.is_skin ? is_skin_valid(table, mesh.vertex_count, n)
                         : is_surface_valid(table, mesh.vertex_count, n))) {
        invalid_file("a mesh");
      }
      mesh.tables.push_back(table);
    }
    meshes.push_back(mesh);
  }
}

const std::vector<std::string>& Scene::names(int32_t kind) const {
  if (kind < 0 || kind > 6) fail(TS_ERROR_ARGUMENT, "kind is %d: give TS_BODY to TS_MOTOR", kind);
  return names_[kind];
}

Place Scene::place(const std::string& field, size_t count, size_t width) const {
  for (size_t i = 0; i < field_names_.size(); ++i) {
    if (field_names_[i] != field) continue;
    if (places_[i].count < count || places_[i].width < width) break;
    return places_[i];
  }
  invalid_file(("the field " + field + " is missing, or too short").c_str());
}

Kernels::Kernel Scene::kernel(const std::string& name) const {
  const auto found = kernels_.find(name);
  if (found == kernels_.end()) invalid_file("kernels");
  return found->second;
}

}  // namespace taichi_soft
