// A running instance of a scene: steps, and the game's calls between steps.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "colliders.hpp"
#include "events.hpp"
#include "fields.hpp"
#include "locks.hpp"
#include "machine.hpp"
#include "passage.hpp"
#include "scene.hpp"
#include "split.hpp"
#include "taichi_soft.h"

namespace taichi_soft {

constexpr size_t kMostFrames = 100000;
constexpr double kMostBreakForce = 1e20;  // equal to MOST_FORCE in taichi_soft/control/breaking.py

inline float as_float(double number) { return static_cast<float>(number); }

struct Vertices {  // list of a body's vertices; an empty list means all vertices
  const int32_t* numbers;
  size_t count;
};

// Hit of a ray, touch of a moving shape, or closest point of a surface.
struct Hit {
  int32_t slot = -1;      // slot of the body; -1 for none
  int32_t collider = -1;  // number of the collider; -1 for none
  int32_t triangle;
  int32_t vertices[3];
  double distance;  // negative if a shape overlaps at the start
  double weights[3];
  Vector point, normal;
  bool is_inside = false;
};

struct Cast {
  int32_t kind;         // TS_RAY, or kind of the shape
  float parameters[8];  // of the shape, as in Collider
  Pose pose;
  Vector direction;
  double reach;
  int32_t targets, mask;
};

// Properties of the world that apply to all bodies.
struct Surroundings {
  Vector gravity;   // [m/s^2]
  double friction;  // friction of the floor
  double floor;     // height of the floor [m]
};

struct Drive {  // settings of a motor
  bool turns, is_fixed, has_point;
  Vector axis, point;  // `point` is 0 unless `has_point`
  double speed, limit;
};

// The part of a body on which a grab acts.
struct Patch {
  std::vector<int32_t> vertices;
  std::vector<double> shares;  // fraction of the grab's force on each vertex, with sum 1
  double strength;             // largest force that the patch allows [N]
};
struct SnapshotHead;

class World {
 public:
  explicit World(std::shared_ptr<Scene> scene);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  const Scene& scene() const { return *scene_; }
  Mutex turn;            // locked during a call
  ThreadId advancing{};  // thread that makes the steps of a frame, and unlocks `turn` between steps

  // Steps.
  void set_fixed_step(double dt, int32_t substeps, int32_t max_steps);
  void on_step(ts_before_step function, void* user) { before_step_ = function, user_ = user; }
  void set_threads(int32_t count);
  void set_job_system(ts_run_jobs function, void* user) { machine_->threads.use_host(function, user); }
  int32_t stable_substeps(double dt) const;
  void step(double dt, int32_t substeps);
  int32_t steps_due(double seconds);  // adds the time of a frame, and returns the number of due steps
  void step_in_time();
  void end_frame();  // drops the time of steps that were due but not made
  ts_before_step before_step() const { return before_step_; }
  void* user() const { return user_; }
  void write_clock(ts_clock* clock, int32_t steps_made) const;
  double alpha() const;

  // Bodies.
  ts_body body_in(int32_t slot) const;
  int32_t slot_of(ts_body body) const;  // fails for a removed body
  const Asset& whole_of(int32_t slot) const { return scene_->assets[size_t(scene_->asset_of_slot[size_t(slot)])]; }
  // Asset at the current level of detail of the body in a slot.
  const Asset& asset_of(int32_t slot) const { return whole_of(slot).level(size_t(levels_[size_t(slot)])); }
  int32_t status_of(int32_t slot) const { return std::min(fields_.body_status(slot), int32_t(kDisabled)); }
  ts_body spawn(int32_t asset, const Vector& place, const Quaternion& turn, const Vector& drift, const Vector& spin);
  void despawn(int32_t slot);
  void set_enabled(int32_t slot, bool is_enabled);
  void read_positions(int32_t slot, double alpha, float* rows);
  void read_mesh(int32_t slot, int32_t mesh, float* positions, float* normals);
  bool has_view() const { return view_origin_ != Vector{0.0, 0.0, 0.0}; }
  bool has_origin(int32_t slot) const;
  std::array<float, 3> local_position(int32_t slot, size_t particle) const;
  Vector exact_position(int32_t slot, size_t vertex) const;
  Vector center_of(int32_t slot) const;
  void set_velocity(int32_t slot, const Vector& linear, const Vector& spin);
  void teleport(int32_t slot, const Vector& center, const Quaternion& turn, bool keeps_velocity);
  void apply_impulse(int32_t slot, const Vector& impulse, Vertices which);
  void apply_force(int32_t slot, const Vector& force, Vertices which);
  void impulse_at(int32_t slot, const Vector& impulse, const Vector& point, double radius);
  void set_gravity_scale(int32_t slot, double scale);
  void set_damping(int32_t slot, double rate);
  void set_sheltered(int32_t slot, bool is_sheltered);
  void pin(int32_t slot, Vertices which);
  void unpin(int32_t slot, Vertices which);
  void set_targets(int32_t slot, Vertices which, const float* targets);

  // Levels of detail.
  int32_t level_of(int32_t slot) const;
  void set_level(int32_t slot, int32_t level, bool may_release);

  // Grabs.
  ts_grab grab_at(int32_t number) const;
  ts_grab grab(int32_t slot, int32_t triangle, const double weights[3], const Vector& point, double frequency,
               double max_force);
  void move_grab(ts_grab grab, const Vector& point);
  void release(ts_grab grab);
  Vector grab_force(ts_grab grab) const;

  // Joints and their handles.
  ts_joint joint_at(int32_t number) const;
  ts_joint join(int32_t slot, Vertices which, int32_t other, const int32_t* onto);
  ts_joint connect(int32_t slot, int32_t other, int32_t kind, const Vector& anchor, Vector axis);
  void release_joint(ts_joint joint);
  void set_break_force(ts_joint joint, double force);
  Vector joint_force(ts_joint joint) const;

  // Motors.
  ts_motor motor_at(int32_t number) const;
  bool turns(ts_motor motor) const;
  ts_motor add_motor(int32_t slot, Vertices which, const Drive& drive);
  void set_motor_speed(ts_motor motor, double speed);
  void set_motor_limit(ts_motor motor, double limit);
  void remove_motor(ts_motor motor);
  double motor_speed(ts_motor motor);
  double motor_effort(ts_motor motor) const;

  // All bodies.
  void wake();
  void set_gravity(const Vector& gravity);
  void shift_origin(const Vector& offset);
  void set_view_origin(const Vector& point);
  void set_friction(double friction);  // friction of the floor
  void set_collider_friction(int32_t number, double friction);
  void set_body_friction(int32_t slot, double friction);
  void set_body_filter(int32_t slot, int32_t group, int32_t mask);
  void set_collider_filter(int32_t number, int32_t group, int32_t mask);
  void set_wind(const Vector& velocity, double density, double drag);
  void radial_impulse(const Vector& center, double impulse, double radius);

  void record_events(int32_t kinds);
  Events& events() { return events_; }

  Hit first_hit(const Vector& origin, const Vector& direction, double farthest);
  Hit closest(const Vector& point, double farthest);
  Hit cast(const Cast& cast);
  Hit nearest(const Vector& point, double farthest, int32_t targets, int32_t mask);
  // Slots of bodies that touch a box with edges of `size`, or a sphere. For a sphere, all numbers of `size` are the
  // radius.
  std::vector<int32_t> overlaps(bool is_box, const Pose& pose, const Vector& size);

  // Colliders.
  Collider& collider(int32_t number);
  int32_t add_collider(const Collider& row);
  void remove_collider(int32_t number);
  double seam() const { return colliders_.seam; }
  void move_collider(int32_t number, const Pose& pose);
  void set_collider_velocity(int32_t number, const Vector& linear, const Vector& spin);
  std::vector<int32_t> bodies_inside(int32_t number);  // slots of the bodies in a sensor
  void set_surface_velocity(int32_t number, const Vector& velocity);
  void teleport_collider(int32_t number, const Pose& pose);
  void collider_impulse(int32_t number, Vector* impulse, Vector* moment);

  // Frames and attachments.
  int32_t add_frame(const Pose& pose);
  void remove_frame(int32_t number);
  void move_frame(int32_t number, const Pose& pose);
  Pose frame_pose(int32_t number) const;
  void attach(int32_t slot, Vertices which, int32_t frame, bool feels);
  void detach(int32_t slot, Vertices which);
  void load(int32_t slot, int32_t frame, Vector* force, Vector* torque) const;
  void set_break_force(int32_t slot, int32_t frame, double force);

  // States.
  uint64_t hash() const;
  size_t snapshot_size() const;
  void snapshot(char* bytes) const;
  void restore(const char* bytes, size_t size);

 private:
  struct Holder {  // a point of a body, given by weights of four vertices
    int32_t vertices[4];
    double weights[4];
  };
  struct MotorRow {
    size_t number;
    int32_t slot, turns, is_fixed, has_point;
    float axis[3], point[3], speed, limit;
    std::vector<int32_t> particles;
  };
  struct Hanging {  // an attachment during a change of level, with its vertices at both levels
    int32_t frame;
    bool feels;
    float break_force;
    std::vector<int32_t> before, after;
  };
  class Packed;

  struct Levels {  // for each slot, the level of detail, and the vertices of the finest level that pins represent
    std::vector<int32_t> levels;
    std::vector<std::vector<int32_t>> held;
    size_t held_count() const;
  };
  Levels present_levels() const;
  bool parse_levels(const char** at, const SnapshotHead& head, Levels* found) const;
  void bind();
  uint32_t write_active_slots(int32_t mask = -1);
  uint32_t write_chosen_colliders(int32_t mask);
  Hit hit_from(const float* row, int32_t collider = -1) const;
  void require_step(double dt) const;
  int32_t require_substeps(double dt, int32_t substeps) const;
  void require_image() const;
  bool are_rows_valid(const char* at, const SnapshotHead& head) const;
  bool is_valid(const Contact& contact, size_t colliders) const;
  bool is_valid(const Inside& inside, size_t colliders) const;
  bool is_valid(const Surroundings& given) const;
  static bool are_frictions(const double* numbers, size_t count);
  void write_surroundings();
  bool is_floor(int32_t number) const;
  void end_forbidden_contacts();
  void give_friction(int32_t slot, double friction);
  Present present() const;
  std::map<Pair, std::array<float, 3>> look();
  void take_down(double dt, const std::vector<int32_t>& frozen);
  size_t frame(int32_t number) const;  // row of a frame in the fields
  std::vector<int32_t> attached_vertices(int32_t slot, int32_t frame) const;
  bool is_felt(int32_t slot, const std::vector<int32_t>& vertices) const;
  void detach_vertices(int32_t slot, const std::vector<int32_t>& vertices);
  size_t grab_of(ts_grab grab) const;  // index of a grab
  void end_grab(size_t number);
  Patch patch_around(const Asset& asset, const int32_t* corners, const double* weights, uint32_t count);
  void write_patch(size_t number, int32_t slot, const Patch& patch);
  void give_target(size_t number, const Vector& point);
  void read_levels();
  bool are_held(int32_t slot, const std::vector<int32_t>& vertices) const;
  void write_slot(int32_t slot, int32_t level, const Motion& motion, int32_t status);
  Motion mapped(const Motion& before, const Asset& source, const Asset& target, const Passage& over,
                const std::vector<int32_t>& held);
  void write_kind(int32_t slot);
  void refill(int32_t slot, int32_t level);
  void require_change(int32_t slot, int32_t level, bool may_release) const;
  std::vector<int32_t> pinned(int32_t slot) const;
  std::vector<int32_t> nearest_at(int32_t slot, std::vector<int32_t> finest, int32_t level) const;
  std::vector<int32_t> finest_held(int32_t slot) const;
  std::map<int32_t, Hanging> attachments_at_level(int32_t slot, const std::vector<int32_t>& held, int32_t level) const;
  void make_room(int32_t slot, int32_t level, bool may_release, std::vector<int32_t>* held,
                 std::map<int32_t, Hanging>* attached);
  void attach_at_level(int32_t slot, const std::map<int32_t, Hanging>& attached, const Motion& before,
                       Motion* after) const;
  Vector rest_point_of_grab(size_t number) const;
  void hold_at(size_t number, const Vector& place);
  std::vector<Vector> touching_points(const Asset& asset, const std::vector<Vector>& x) const;
  Vector vertex_place(int32_t slot, int32_t vertex) const;
  std::vector<Holder> embedded(const std::vector<Vector>& points, const double* x, size_t count,
                               const Archive::View<int32_t>& tets);
  std::vector<Holder> holders_at(const std::vector<Vector>& points, int32_t other,
                                 const std::function<std::string(size_t)>& name);
  std::vector<Holder> holders_on(int32_t other, const std::vector<int32_t>& partners) const;
  double follow_speed(int32_t slot, std::vector<int32_t> held) const;
  Vector in_principal_axes(int32_t slot, const Vector& direction) const;
  ts_joint add_joint(int32_t slot, const std::vector<Holder>& own, int32_t other, const std::vector<Holder>& holders,
                     const Vector& axis);
  size_t joint_of(ts_joint joint) const;  // index of a joint
  size_t joint_rows() const;              // number of particles in all joints
  void end_joint(size_t number);
  void break_joints(double dt);
  void break_attachments(double dt);
  void joints_have_changed();
  Vector axis_at_rest(int32_t slot, const std::vector<int32_t>& vertices, const Vector& axis);
  std::vector<MotorRow> motors() const;
  void write_motors(const std::vector<MotorRow>& rows);
  void mark_driven();
  size_t motor_of(ts_motor motor) const;
  size_t motor_rows() const;
  void end_motor(size_t number);
  bool are_joints_valid(const Packed& packed, const SnapshotHead& head) const;
  bool are_motors_valid(const Packed& packed, const SnapshotHead& head) const;
  bool lies_in(int32_t particle, int32_t slot, int32_t level) const;
  void write_colliders();
  void wake_beside(const Collider& row);  // sensors wake no body
  // Slot of each body in one of these sensors, with the number of the sensor, ascending.
  std::vector<std::pair<int32_t, int32_t>> inside_sensors(const std::vector<int32_t>& numbers);
  bool aim_pins(double dt);
  bool prepare_colliders(double dt);
  void launch_step(int32_t substeps, double h);
  void mark_modified(int32_t slot);  // wakes a body and discards cached frames; -1 means all bodies
  void wake_slot(int32_t slot);
  void wake_near(const Box& box);
  Box box_of(int32_t slot) const;
  std::vector<int32_t> checked(int32_t slot, Vertices which, bool may_be_all) const;  // vertices in ascending order
  void give_rows(int32_t slot, const std::vector<int32_t>& vertices);
  void require_unattached(int32_t slot, const std::vector<int32_t>& vertices) const;
  double mass_of(int32_t slot, const std::vector<int32_t>& vertices) const;
  size_t begin_of(int32_t slot) const { return size_t(scene_->begin_of_slot[slot]); }
  size_t particle(int32_t slot, size_t vertex) const { return begin_of(slot) + size_t(asset_of(slot).rank[vertex]); }
  std::vector<float> place_rows(const Asset& asset, const Vector& place, const Quaternion& turn, const Vector& drift,
                                const Vector& spin) const;

  std::shared_ptr<Scene> scene_;
  std::unique_ptr<Machine> machine_;
  Colliders colliders_;
  std::vector<ColliderMotion> motion_;
  Events events_;
  Surroundings surroundings_;
  std::vector<double> friction_;         // friction of each body in contact with other bodies
  std::vector<float> present_, coming_;  // poses of frames after the last and the next step, (f, kFrameWidth): rotation
                                         // by rows, then position
  std::vector<unsigned char> frame_alive_;
  Vector view_origin_ = {0.0, 0.0, 0.0};    // point to which drawn positions are relative
  std::vector<int32_t> levels_;             // level of detail in each slot, even in empty slots
  std::vector<std::vector<int32_t>> held_;  // vertices of the finest level that pins of a coarser level represent
  std::vector<int32_t> attachments_;        // attachment of each particle, or 0
  std::vector<unsigned char> feels_;        // 1 for each particle whose load on a frame is reported
  std::vector<float> break_forces_;         // force at which the particle's attachment breaks [N]; 0 for never
  std::vector<uint32_t> generations_, grab_generations_, joint_generations_, motor_generations_;

  int64_t steps_ = 0;
  double time_ = 0.0, last_dt_ = 0.0;
  double dt_ = 1.0 / 60.0, remainder_ = 0.0, dropped_ = 0.0;
  int32_t steps_left_ = 0;  // steps that remain in the current frame
  double picture_ = 1.0;    // interpolation factor between before (0) and after (1) the last step
  int32_t substeps_ = 0, max_steps_ = 8;
  ts_before_step before_step_ = nullptr;
  void* user_ = nullptr;
  bool has_work_ = true;   // true if a pinned particle has a target or has just reached its target
  bool is_still_ = false;  // true if all bodies slept after the last step and nothing has changed since then
  double rows_at_ = -1.0;  // alpha of the cached positions; negative if the cache is outdated

  Fields fields_;
  size_t collider_room_ = 0;
  std::vector<Field<float>> constants_;  // constants of tetrahedra, if any asset has levels
};

}  // namespace taichi_soft
