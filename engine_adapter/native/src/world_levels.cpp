// Levels of detail, with the same results as taichi_soft/levels/level_change.py and reattaching.py.

#include <algorithm>

#include "error.hpp"
#include "world.hpp"

namespace taichi_soft {

namespace {

template <typename Number>
Argument array_of(const Archive::View<Number>& view, size_t width = 0) {
  return Machine::array(view.data, uint32_t(width > 0 ? view.count / width : view.count), uint32_t(width));
}

}  // namespace

// Reads the levels of all bodies from the world file, and checks that they fit the slots.
void World::read_levels() {
  const Archive& archive = scene_->archive;
  const size_t slots = size_t(scene_->slot_count);
  const auto levels = archive.get<int32_t>("levels/level"), counts = archive.get<int32_t>("levels/held_counts");
  const auto held = archive.get<int32_t>("levels/held");
  const auto attachments = archive.get<int32_t>("frames/attachment");
  levels_.assign(levels.begin(), levels.end());
  held_.assign(slots, {});
  const auto breaks = archive.get<float>("frames/break_force");
  attachments_.assign(attachments.begin(), attachments.end());
  break_forces_.assign(breaks.begin(), breaks.end());
  bool is_whole = levels.count == slots && counts.count == slots &&
                  attachments_.size() == size_t(scene_->particle_count) && break_forces_.size() == attachments_.size();
  size_t at = 0;
  for (size_t slot = 0; is_whole && slot < slots; ++slot) {
    const Asset& asset = whole_of(int32_t(slot));
    is_whole = levels_[slot] >= 0 && size_t(levels_[slot]) < asset.level_count() && counts[slot] >= 0 &&
               at + size_t(counts[slot]) <= held.count;
    for (int32_t i = 0; is_whole && i < counts[slot]; ++i) held_[slot].push_back(held[at++]);
    is_whole = is_whole && are_held(int32_t(slot), held_[slot]);
  }
  if (!is_whole || at != held.count) fail(TS_ERROR_FILE, "the world file is invalid: levels. Export it again");
  if (!scene_->has_levels) return;
  const auto count_of = [&](const std::string& field) { return scene_->place(field).count; };
  const auto fits = [&](const std::string& range, size_t slot, size_t most, size_t each, size_t rows) {
    const int32_t first = Field<int32_t>(machine_->root(), scene_->place(range, slots, 2))(slot);
    return first >= 0 && each * size_t(first) + rows <= most;
  };
  for (const std::string& name : scene_->constant_names) constants_.push_back({machine_->root(), scene_->place(name)});
  for (size_t slot = 0; slot < slots; ++slot) {
    const Asset& asset = whole_of(int32_t(slot));
    if (asset.level_count() == 1) continue;
    const SlotRows& rows = asset.rows;
    bool is_there = fits("body_particles", slot, size_t(scene_->particle_count), 1, asset.vertex_count()) &&
                    fits("body_blocks", slot, count_of("tet_vertices"), 4 * kLanes, rows.tet_vertices.count) &&
                    fits("body_blocks", slot, count_of("tet_rest_inverse"), 9 * kLanes, rows.rest_inverses.count / 2) &&
                    fits("body_edges", slot, count_of("edge_damping"), 1, rows.edges.count / 2) &&
                    fits("body_edge_blocks", slot, count_of("edge_blocks"), 1, rows.edge_blocks.count / 2) &&
                    fits("body_triangles", slot, count_of("triangle_vertices"), 1, rows.triangles.count / 3) &&
                    fits("body_outer", slot, count_of("outer_particle"), 1, rows.outer.count);
    const size_t blocks = rows.tet_vertices.count / (4 * kLanes);
    for (size_t i = 0; is_there && i < constants_.size(); ++i) {
      const size_t each = rows.constants[i].count / blocks;
      is_there = fits("body_blocks", slot, count_of(scene_->constant_names[i]), each, rows.constants[i].count);
      for (const Asset& coarse : asset.coarser) {
        const size_t own = coarse.rows.tet_vertices.count / (4 * kLanes);
        is_there = is_there && coarse.rows.constants[i].count == each * own;
      }
    }
    if (is_there && scene_->has_hulls) {
      is_there =
          fits("hull.body_outer", slot, count_of("hull.outer_particle"), 1, rows.outer.count) &&
          fits("hull.body_outer", slot, count_of("hull.outer_particle"), 1, rows.touching_outer.count) &&
          fits("hull.body_triangles", slot, count_of("hull.triangle_vertices"), 1, rows.triangles.count / 3) &&
          fits("hull.body_triangles", slot, count_of("hull.triangle_vertices"), 1, rows.touching_triangles.count / 3) &&
          fits("hull.body_points", slot, count_of("hull.carriers"), 1, rows.carriers.count / 4);
    }
    for (size_t level = 0; is_there && scene_->has_soft_contact && level < asset.level_count(); ++level) {
      // A coarser level can have more contact edges than the finest level.
      const Field<int32_t> range(machine_->root(), scene_->place("soft.body_edges", slots, 2));
      const int32_t total = int32_t(count_of("soft.edge_corners"));
      const int32_t first = range(slot), end = slot + 1 < slots ? range(slot + 1) : total;
      const size_t count = asset.level(level).rows.contact_edges.count / 4;
      is_there = first >= 0 && first <= end && end <= total && count <= size_t(end - first);
    }
    if (!is_there) fail(TS_ERROR_FILE, "the world file is invalid: a level of detail. Export it again");
  }
}

// True if all `vertices` are valid vertices of the finest level of the body in a slot.
bool World::are_held(int32_t slot, const std::vector<int32_t>& vertices) const {
  const size_t n = whole_of(slot).vertex_count();
  return std::all_of(vertices.begin(), vertices.end(), [n](int32_t v) { return v >= 0 && size_t(v) < n; });
}

// Writes a level of an asset into the slot of a body, with a motion and a status.
void World::write_slot(int32_t slot, int32_t level, const Motion& motion, int32_t status) {
  const Asset& asset = whole_of(slot).level(size_t(level));
  const SlotRows& rows = asset.rows;
  float* numbers = machine_->rows.room<float>(motion.numbers.size());
  std::transform(motion.numbers.begin(), motion.numbers.end(), numbers, as_float);
  const size_t inverses = rows.rest_inverses.count / 2;
  machine_->launch(
      "write_body",
      {Machine::whole(slot), Machine::whole(status), Machine::whole(slot),
       Machine::array(machine_->rows, uint32_t(motion.count), Motion::kWidth), array_of(rows.rest, 3),
       array_of(asset.rank), array_of(rows.tet_vertices), array_of(rows.tet_edges),
       Machine::array(rows.rest_inverses.data, 2, uint32_t(inverses)), array_of(rows.edges, 2),
       array_of(rows.edge_damping), array_of(rows.edge_blocks, 2), array_of(rows.triangles, 3), array_of(rows.outer)});
  const size_t blocks = rows.tet_vertices.count / (4 * kLanes), first = size_t(fields_.body_blocks(size_t(slot)));
  for (size_t i = 0; i < constants_.size(); ++i) {
    const Archive::View<float>& each = rows.constants[i];
    const size_t begin = first * (each.count / blocks);
    for (size_t k = 0; k < each.count; ++k) constants_[i](begin + k) = each[k];
  }
  if (scene_->has_hulls) {
    machine_->launch("write_touching",
                     {Machine::whole(slot), array_of(rows.touching_outer), array_of(rows.touching_triangles, 3),
                      array_of(rows.carriers, 4), array_of(rows.weights, 4)});
  }
  if (scene_->has_soft_contact) {
    machine_->launch("write_contact_edges",
                     {Machine::whole(slot), Machine::whole(rows.sharp_edges[0]), array_of(rows.contact_edges, 4)});
  }
  levels_[size_t(slot)] = level;
  write_kind(slot);
}

void World::write_kind(int32_t slot) {
  machine_->launch("write_kind", {Machine::whole(slot), array_of(asset_of(slot).rows.kind)});
}

// Writes a level of the slot's asset into a slot that is reused. The body is at rest and absent.
void World::refill(int32_t slot, int32_t level) {
  write_slot(slot, level, Motion(whole_of(slot).level(size_t(level)).vertex_count()), kAbsent);
}

int32_t World::level_of(int32_t slot) const { return levels_[size_t(slot)]; }

void World::require_change(int32_t slot, int32_t level, bool may_release) const {
  const Asset& asset = whole_of(slot);
  if (level < 0 || size_t(level) >= asset.level_count()) {
    const std::string fix = asset.level_count() > 1 ? "give 0 to " + std::to_string(asset.level_count() - 1)
                                                    : "from_surface with cells=(12, 8, 5) makes several";
    fail(TS_ERROR_ARGUMENT, "level is %d, and asset %d has %zu: %s", level, scene_->asset_of_slot[size_t(slot)],
         asset.level_count(), fix.c_str());
  }
  bool has_joints = false, has_motors = false;
  for (size_t j = 0; j < kMostJoints; ++j) {
    has_joints = has_joints || fields_.joints.bodies(j, 0) == slot + 1 || fields_.joints.bodies(j, 1) == slot + 1;
  }
  for (size_t m = 0; m < kMostMotors; ++m) has_motors = has_motors || fields_.motors.motor.body(m) == slot + 1;
  if ((has_joints || has_motors) && !may_release) {
    fail(TS_ERROR_STATE,
         "the body in slot %d has %s%s%s on its vertices: release or remove them before changing its level, or "
         "call ts_body_set_level with release = 1",
         slot, has_joints ? "joints" : "", has_joints && has_motors ? " and " : "", has_motors ? "motors" : "");
  }
  if (fields_.body_status(slot) == kFrozen) {
    fail(TS_ERROR_STATE, "the body in slot %d is frozen: despawn it, and spawn another", slot);
  }
}

std::vector<int32_t> World::pinned(int32_t slot) const {
  std::vector<int32_t> found;
  for (size_t v = 0; v < asset_of(slot).vertex_count(); ++v) {
    if (fields_.particle_inv_mass(particle(slot, v)) == 0.0f) found.push_back(int32_t(v));
  }
  return found;
}

// Vertices of a level that are nearest to the vertices in `finest` of the finest level.
std::vector<int32_t> World::nearest_at(int32_t slot, std::vector<int32_t> finest, int32_t level) const {
  const Asset& asset = whole_of(slot);
  if (level != 0) return nearest_vertices(asset, finest, asset.level(size_t(level)));
  std::sort(finest.begin(), finest.end());
  finest.erase(std::unique(finest.begin(), finest.end()), finest.end());
  return finest;
}

// Vertices of the finest level that the held vertices represent.
std::vector<int32_t> World::finest_held(int32_t slot) const {
  const std::vector<int32_t> present = pinned(slot), &held = held_[size_t(slot)];
  const int32_t level = level_of(slot);
  if (present.empty() || level == 0) return present;
  if (!held.empty() && nearest_at(slot, held, level) == present) return held;
  return nearest_of_each(asset_of(slot), present, whole_of(slot));
}

// Attachments of a body with their vertices at another level, by number. `held` lists the held vertices of that level.
std::map<int32_t, World::Hanging> World::attachments_at_level(int32_t slot, const std::vector<int32_t>& held,
                                                              int32_t level) const {
  std::map<int32_t, Hanging> found;
  const std::vector<int32_t> sources = pinned(slot);
  for (int32_t vertex : sources) {
    const size_t p = particle(slot, size_t(vertex));
    if (fields_.particle_aim(p) < kWithFrame) continue;
    Hanging& each = found[attachments_[p]];
    each.frame = fields_.particle_aim(p) - kWithFrame, each.feels = feels_[p] != 0;
    each.break_force = break_forces_[p];
    each.before.push_back(vertex);
  }
  if (found.empty() || held.empty()) return found;
  const std::vector<int32_t> nearest =
      nearest_sources(asset_of(slot), sources, whole_of(slot).level(size_t(level)), held);
  for (size_t i = 0; i < held.size(); ++i) {
    const size_t p = particle(slot, size_t(nearest[i]));
    if (fields_.particle_aim(p) >= kWithFrame) found[attachments_[p]].after.push_back(held[i]);
  }
  return found;
}

// Prepares a change to another level: releases joints, motors, and attachments without a vertex at that level, and
// finds the held vertices of that level.
void World::make_room(int32_t slot, int32_t level, bool may_release, std::vector<int32_t>* held,
                      std::map<int32_t, Hanging>* attached) {
  for (size_t j = 0; j < kMostJoints; ++j) {
    if (fields_.joints.bodies(j, 0) == slot + 1 || fields_.joints.bodies(j, 1) == slot + 1) end_joint(j);
  }
  for (size_t m = 0; m < kMostMotors; ++m) {
    if (fields_.motors.motor.body(m) == slot + 1) end_motor(m);
  }
  for (bool is_done = false; !is_done;) {  // detaching removes held vertices, on which other attachments may depend
    std::vector<int32_t> finest = finest_held(slot);
    *held = nearest_at(slot, finest, level);
    *attached = attachments_at_level(slot, *held, level);
    is_done = true;
    std::vector<int32_t> homeless;
    for (const auto& each : *attached) {
      if (!each.second.after.empty()) continue;
      if (!may_release) {
        fail(TS_ERROR_STATE,
             "the attachment to frame %d would hold nothing at level %d: "
             "release it with ts_body_detach before changing the level, or call ts_body_set_level with release = 1",
             each.second.frame, level);
      }
      homeless.insert(homeless.end(), each.second.before.begin(), each.second.before.end());
      is_done = false;
    }
    held_[size_t(slot)] = std::move(finest);
    detach_vertices(slot, homeless);
  }
}

// Writes the attached vertices to `after`, and distributes the load of the last step over the vertices of each
// attachment.
void World::attach_at_level(int32_t slot, const std::map<int32_t, Hanging>& attached, const Motion& before,
                            Motion* after) const {
  for (const auto& each : attached) {
    const Hanging& held = each.second;
    const float* row = present_.data() + kFrameWidth * size_t(held.frame);
    Vector load = {0.0, 0.0, 0.0}, place;
    for (size_t k = 0; k < 3; ++k)
      place[k] = double(row[9 + k]) + double(row[12 + k]) - double(fields_.body_origin(size_t(slot), k));
    for (int32_t vertex : held.before) {
      for (size_t k = 0; k < 3; ++k) load[k] += before(size_t(vertex), Motion::kReaction + k);
    }
    for (int32_t vertex : held.after) {
      double arm[3];
      for (size_t k = 0; k < 3; ++k) arm[k] = (*after)(size_t(vertex), Motion::kPosition + k) - place[k];
      for (size_t k = 0; k < 3; ++k) {
        (*after)(size_t(vertex), Motion::kTarget + k) =
            double(row[k]) * arm[0] + double(row[3 + k]) * arm[1] + double(row[6 + k]) * arm[2];
        (*after)(size_t(vertex), Motion::kReaction + k) = load[k] / double(held.after.size());
      }
    }
  }
}

// Point of the rest shape that a grab holds.
Vector World::rest_point_of_grab(size_t g) const {
  const int32_t slot = fields_.grabs.body(g) - 1;
  const Asset& asset = asset_of(slot);
  double weights[kGrabCorners], sum = 0.0;
  for (size_t i = 0; i < kGrabCorners; ++i) weights[i] = double(fields_.grabs.weights(g, i)), sum = sum + weights[i];
  Vector place = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < kGrabCorners; ++i) {
    const int32_t rank = fields_.grabs.corners(g, i) - int32_t(begin_of(slot));
    const auto at = std::find(asset.rank.begin(), asset.rank.end(), rank);
    const size_t vertex = at == asset.rank.end() ? 0 : size_t(at - asset.rank.begin());
    for (size_t k = 0; k < 3; ++k) place[k] += weights[i] / sum * asset.vertices[3 * vertex + k];
  }
  return place;
}

// Moves a grab to the body's current tetrahedra, around a point of the rest shape.
void World::hold_at(size_t g, const Vector& place) {
  const int32_t slot = fields_.grabs.body(g) - 1;
  const Asset& asset = asset_of(slot);
  const Holder at = embedded({place}, asset.vertices.data, asset.vertex_count(), asset.tets)[0];
  const Patch patch = patch_around(asset, at.vertices, at.weights, 4);
  for (size_t i = 0; i < kGrabCorners; ++i) {
    fields_.grabs.corners(g, i) = int32_t(particle(slot, size_t(at.vertices[i])));
    fields_.grabs.weights(g, i) = as_float(at.weights[i]);
  }
  fields_.grabs.limits(g, 0) = std::min(fields_.grabs.limits(g, 1), as_float(patch.strength));
  write_patch(g, slot, patch);
}

// Converts a motion to another level. The vertices in `held` are pinned.
Motion World::mapped(const Motion& before, const Asset& source, const Asset& target, const Passage& over,
                     const std::vector<int32_t>& held) {
  Motion after(target.vertex_count());
  std::vector<int32_t> sources, nearest(after.count, -1);
  for (size_t v = 0; v < before.count; ++v) {
    if (before(v, Motion::kInvMass) == 0.0) sources.push_back(int32_t(v));
  }
  std::vector<double> weights(before.count, 0.0);
  for (int32_t vertex : sources) weights[size_t(vertex)] = 1.0 / double(sources.size());
  if (!held.empty()) {
    const std::vector<int32_t> found = nearest_sources(source, sources, target, held);
    for (size_t i = 0; i < held.size(); ++i) nearest[size_t(held[i])] = found[i];
  }
  const uint32_t n = uint32_t(before.count), m = uint32_t(after.count);
  machine_->launch("map_motion",
                   {Machine::array(before.numbers.data(), n, Motion::kWidth), array_of(over.sources),
                    array_of(over.begins), array_of(over.weights), array_of(target.masses),
                    array_of(source.vertices, 3), array_of(target.vertices, 3), Machine::array(weights.data(), n),
                    Machine::array(nearest.data(), m), Machine::array(after.numbers.data(), m, Motion::kWidth)});
  return after;
}

void World::set_level(int32_t slot, int32_t level, bool may_release) {
  require_change(slot, level, may_release);
  const int32_t from = level_of(slot);
  if (level == from) return;
  const Asset &whole = whole_of(slot), &source = whole.level(size_t(from)), &target = whole.level(size_t(level));
  std::vector<int32_t> held;
  std::map<int32_t, Hanging> attached;
  make_room(slot, level, may_release, &held, &attached);
  std::vector<std::pair<size_t, Vector>> grabbed;
  for (size_t g = 0; g < kMostGrabs; ++g) {
    if (fields_.grabs.body(g) == slot + 1) grabbed.push_back({g, rest_point_of_grab(g)});
  }
  Motion before(source.vertex_count());
  const float* found = machine_->rows.room<float>(before.numbers.size());
  machine_->launch("read_motion",
                   {Machine::whole(slot), Machine::array(machine_->rows, uint32_t(before.count), Motion::kWidth)});
  std::copy(found, found + before.numbers.size(), before.numbers.begin());
  Motion after = mapped(before, source, target, whole.passage(size_t(from), size_t(level)), held);
  attach_at_level(slot, attached, before, &after);
  std::fill_n(feels_.begin() + std::ptrdiff_t(begin_of(slot)), whole.vertex_count(), 0);
  std::fill_n(attachments_.begin() + std::ptrdiff_t(begin_of(slot)), whole.vertex_count(), 0);
  std::fill_n(break_forces_.begin() + std::ptrdiff_t(begin_of(slot)), whole.vertex_count(), 0.0f);
  write_slot(slot, level, after, fields_.body_status(slot));
  if (scene_->has_soft_contact) machine_->launch("mark_placed", {Machine::whole(slot)});
  give_friction(slot, friction_[size_t(slot)]);
  for (const auto& each : attached) {
    for (int32_t vertex : each.second.after) {
      const size_t p = particle(slot, size_t(vertex));
      attachments_[p] = each.first, feels_[p] = each.second.feels ? 1 : 0;
      break_forces_[p] = each.second.break_force;
    }
  }
  for (const auto& each : grabbed) hold_at(each.first, each.second);
  mark_modified(slot);
}

}  // namespace taichi_soft
