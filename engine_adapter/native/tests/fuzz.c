/* Calls the library with random valid and invalid arguments: fuzz FOLDER SECONDS SEED.
 *
 * The exit code is 0 if every call returned TS_OK or an error with a text, and no refused call changed the state of the
 * world.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "taichi_soft.h"

#define WORLDS 2
#define ROOM 100000

static uint64_t state;

static uint64_t next(void) { /* xorshift64* of Vigna 2016 */
  state ^= state >> 12;
  state ^= state << 25;
  state ^= state >> 27;
  return state * 2685821657736338717u;
}

static uint32_t below(uint32_t limit) { return (uint32_t)((next() >> 33) % limit); }

static int one_in(uint32_t count) { return below(count) == 0; }

static int is_tame; /* true for calls whose arguments are likely valid; random arguments rarely are */

static int bad(uint32_t count) { return !is_tame && one_in(count); }

static double number(void) {
  static const double odd[] = {0.0, -0.0, 1.0, -1.0, 1e-300, 1e30, -1e30, 1e300, 1e9, 1e-9};
  if (bad(12)) return NAN;
  if (bad(12)) return one_in(2) ? INFINITY : -INFINITY;
  if (bad(6)) return odd[below(10)];
  return 4.0 * ((double)(next() >> 11) / 9007199254740992.0) - 1.0;
}

static double* numbers(int count) {
  static double pool[8][16];
  static int which;
  double* found = pool[which = (which + 1) % 8];
  if (bad(25)) return NULL;
  for (int i = 0; i < count; ++i) found[i] = number();
  if (count == 4 && !bad(4)) {
    const double length = sqrt(found[0] * found[0] + found[1] * found[1] + found[2] * found[2] + found[3] * found[3]);
    for (int i = 0; i < 4 && length > 0.0; ++i) found[i] /= length;
  }
  return found;
}

static int32_t whole(int32_t limit) {
  if (bad(10)) return (int32_t)next();
  return is_tame ? (int32_t)below((uint32_t)limit) : (int32_t)below((uint32_t)limit + 2) - 1;
}

static ts_scene scene;
static ts_world worlds[WORLDS];

static ts_world any_world(void) {
  if (bad(20)) return next();
  return worlds[below(WORLDS)];
}

static ts_body any_body(ts_world world) {
  ts_body found = 0;
  if (bad(15)) return next();
  ts_world_get_body(world, whole(9), &found);
  return found;
}

static ts_grab any_grab(ts_world world) { /* a current grab, an earlier grab, or a grab of another world */
  static ts_grab known[16];
  ts_grab found = 0;
  if (bad(15)) return next();
  if (bad(6)) return known[below(16)];
  ts_world_get_grab(world, bad(4) ? whole(16) : (int32_t)below(2), &found);
  return known[below(16)] = found;
}

static float rows[ROOM], normals[ROOM];
static int32_t vertices[64];

static const int32_t* list(size_t* count) {
  const uint32_t first = below(27);
  *count = below(20);
  for (int i = 0; i < 20; ++i) vertices[i] = is_tame ? (int32_t)((first + (uint32_t)i) % 27) : whole(27);
  if (bad(20)) *count = (size_t)next();
  return *count > 20 || bad(20) ? NULL : vertices;
}

static ts_pose* pose(void) {
  static ts_pose found;
  const double* turn = numbers(4);
  if (bad(25)) return NULL;
  for (int i = 0; i < 3; ++i) found.position[i] = number();
  for (int i = 0; i < 4; ++i) found.rotation[i] = turn == NULL ? number() : turn[i];
  return &found;
}

static uint32_t size_of(size_t size) { return bad(10) ? (uint32_t)next() : (uint32_t)size; }

static void broken(const char* what) {
  fprintf(stderr, "%s (last error: %s)\n", what, ts_last_error());
  exit(1);
}

static ts_pull* pull(void) {
  static ts_pull found;
  double* weights = found.weights;
  memset(&found, 0, sizeof found);
  found.struct_size = size_of(sizeof found);
  found.triangle = whole(40);
  for (int i = 0; i < 3; ++i) weights[i] = bad(20) ? number() : 0.1 + below(100), found.point[i] = number();
  const double sum = weights[0] + weights[1] + weights[2];
  for (int i = 0; i < 3 && !bad(30); ++i) weights[i] /= sum;
  found.frequency = bad(4) ? number() : 5.0;
  found.max_force = number();
  return bad(20) ? NULL : &found;
}

/* Drain events, and check that they have valid contents and no longer wait. */
static ts_result drain(ts_world world) {
  static ts_event events[100];
  const int has_room = !bad(10);
  const size_t capacity = has_room ? (one_in(4) ? below(3) : below(101)) : bad(3) ? 0 : (size_t)next();
  size_t count = 0, left = 0;
  const ts_result result =
      ts_world_drain_events(world, has_room ? events : NULL, bad(10) ? (size_t)next() : sizeof(ts_event), capacity,
                            bad(10) ? NULL : &count);
  if (result != TS_OK) return result;
  if (count > capacity) broken("more events than there is room for");
  for (size_t i = 0; i < count; ++i) {
    const ts_event* e = events + i;
    const int is_contact = e->kind == TS_CONTACT_BEGAN || e->kind == TS_CONTACT_ENDED || e->kind == TS_BROKE;
    const int is_sensed = e->kind == TS_ENTERED || e->kind == TS_LEFT;
    if (e->kind <= 0 || e->kind > TS_BROKE || (e->kind & (e->kind - 1)) != 0) broken("an event of no kind");
    if (e->body == 0 || e->step < 0 || e->collider < -1) broken("an event of nobody, or never");
    if ((e->collider >= 0) + (e->other != 0) != (is_contact || is_sensed)) broken("an event with one too many, or too few");
    if (!isfinite(e->time) || !isfinite(e->impulse[0] + e->impulse[1] + e->impulse[2]) || !(e->duration >= 0.0)) {
      broken("an event that is not finite");
    }
  }
  if (count < capacity && (ts_world_drain_events(world, events, sizeof(ts_event), 100, &left) != TS_OK || left != 0)) {
    broken("events are left");
  }
  return result;
}

static ts_result overlap(ts_world world) {
  static ts_body bodies[16];
  const int has_room = !bad(10);
  const size_t capacity = has_room ? (one_in(2) ? 16 : below(16)) : bad(3) ? 0 : (size_t)next();
  size_t count = 0;
  ts_body* into = has_room ? bodies : NULL;
  size_t* size = bad(10) ? NULL : &count;
  const ts_result result = one_in(2) ? ts_world_overlap_sphere(world, numbers(3), number(), into, capacity, size)
                                     : ts_world_overlap_box(world, pose(), numbers(3), into, capacity, size);
  if (result != TS_OK) return result;
  if (count > capacity) broken("more bodies than there is room for");
  for (size_t i = 0; i < count; ++i) {
    const int32_t slot = (int32_t)(bodies[i] & 0xFFFFFFFFu) - 1;
    ts_body there = 0;
    if (ts_world_get_body(world, slot, &there) != TS_OK || there != bodies[i]) broken("a body that is not there");
    if (i > 0 && (bodies[i - 1] & 0xFFFFFFFFu) - 1 >= (uint32_t)slot) broken("bodies are not in the order of slots");
  }
  return result;
}

static ts_result take_hold(ts_world world, ts_body body) {
  ts_grab made = 0, there = 0;
  ts_grab* grab = bad(20) ? NULL : &made;
  const ts_result result = ts_body_grab(world, body, pull(), grab);
  if (result != TS_OK) return result;
  for (int32_t i = 0; i < 16 && there != made; ++i) {
    if (ts_world_get_grab(world, i, &there) != TS_OK) broken("no number of a grab");
  }
  if (made == 0 || there != made) broken("a grab that is not there");
  return result;
}

/* Body whose load is read. The body is usually attached to `its_frame`. */
static ts_body hanging;
static int32_t its_frame;

static ts_result attach(ts_world world, ts_body body) {
  size_t count = 0;
  const int32_t* which = list(&count);
  const int32_t frame = whole(3);
  const ts_result result = ts_body_attach(world, body, which, count, frame, whole(2));
  if (result == TS_OK) hanging = body, its_frame = frame;
  return result;
}

static ts_result add_frame(ts_world world) {
  int32_t made = -1;
  ts_pose there;
  const ts_result result = ts_frame_add(world, pose(), bad(20) ? NULL : &made);
  if (result == TS_OK && (ts_frame_get_pose(world, made, &there) != TS_OK || !isfinite(there.position[0]))) {
    broken("a frame that is not there");
  }
  return result;
}

static ts_joint any_joint(ts_world world) {
  ts_joint found = 0;
  if (bad(15)) return next();
  ts_world_get_joint(world, (int32_t)below(bad(4) ? 66 : 3), &found);
  return found;
}

static ts_motor any_motor(ts_world world) {
  ts_motor found = 0;
  if (bad(15)) return next();
  ts_world_get_motor(world, (int32_t)below(bad(4) ? 66 : 3), &found);
  return found;
}

static ts_result join(ts_world world, ts_body body) {
  static int32_t partners[32];
  size_t count = 0;
  const int32_t* which = list(&count);
  ts_joint made = 0, there = 0;
  ts_joint* joint = bad(20) ? NULL : &made;
  for (int i = 0; i < 32; ++i) partners[i] = whole(27);
  const int has_onto = count <= 20 && one_in(2);
  const ts_result result = ts_body_join(world, body, which, count, any_body(world), has_onto ? partners : NULL, joint);
  if (result != TS_OK) return result;
  const int32_t its_number = (int32_t)(made & 0xFFFFFFFFu) - 1;
  if (ts_world_get_joint(world, its_number, &there) != TS_OK || there != made) broken("a joint that is not there");
  if (one_in(2)) return ts_joint_set_break_force(world, made, bad(4) ? number() : fabs(number()));
  return result;
}

static ts_result add_motor(ts_world world, ts_body body) {
  size_t count = 0;
  const int32_t* which = list(&count);
  ts_drive drive;
  ts_motor made = 0, there = 0;
  ts_motor* motor = bad(20) ? NULL : &made;
  memset(&drive, 0, sizeof drive);
  drive.struct_size = size_of(sizeof drive);
  drive.turns = whole(2), drive.is_fixed = whole(2), drive.has_point = one_in(4);
  for (int i = 0; i < 3; ++i) drive.axis[i] = number(), drive.point[i] = number();
  drive.speed = number(), drive.limit = bad(4) ? number() : fabs(number());
  const ts_result result = ts_body_add_motor(world, body, which, count, bad(20) ? NULL : &drive, motor);
  if (result != TS_OK) return result;
  const int32_t number_of_it = (int32_t)(made & 0xFFFFFFFFu) - 1;
  if (ts_world_get_motor(world, number_of_it, &there) != TS_OK || there != made) broken("a motor that is not there");
  return result;
}

static ts_result one_call(ts_world world) {
  const ts_body body = any_body(world);
  size_t count = 0;
  const int32_t* which = list(&count);
  switch (below(71)) {
    case 0: case 1: case 2: return ts_world_step(world, bad(8) ? number() : 0.01, bad(8) ? whole(50) : 4);
    case 3: {
      ts_clock clock = {size_of(sizeof clock), 0, 0, 0, 0, 0};
      return ts_world_advance(world, bad(4) ? number() : 0.02, one_in(4) ? NULL : &clock);
    }
    case 4: return ts_body_apply_impulse(world, body, numbers(3), which, count);
    case 5: return ts_body_apply_force(world, body, numbers(3), which, count);
    case 6: return ts_body_impulse_at(world, body, numbers(3), numbers(3), number());
    case 7: return ts_body_set_velocity(world, body, numbers(3), numbers(3));
    case 8: return ts_body_teleport(world, body, numbers(3), numbers(4), whole(2));
    case 9: return ts_body_set_gravity_scale(world, body, number());
    case 10: return ts_body_set_damping(world, body, number());
    case 11: return ts_body_set_sheltered(world, body, whole(2));
    case 12: return ts_body_pin(world, body, which, count);
    case 13: return ts_body_unpin(world, body, which, count);
    case 14: {
      for (int i = 0; i < 60; ++i) rows[i] = (float)number();
      return ts_body_set_targets(world, body, which, count, bad(20) ? NULL : rows);
    }
    case 15: return ts_world_set_wind(world, numbers(3), number(), number());
    case 16: return ts_world_radial_impulse(world, numbers(3), number(), number());
    case 17: return ts_world_wake(world);
    case 18: case 19: {
      ts_placement place;
      ts_body made = 0;
      const double *turn = numbers(4);
      memset(&place, 0, sizeof place);
      place.struct_size = size_of(sizeof place);
      for (int i = 0; i < 3; ++i) place.position[i] = number(), place.velocity[i] = number(), place.spin[i] = number();
      for (int i = 0; i < 4; ++i) place.rotation[i] = turn == NULL ? number() : turn[i];
      return ts_world_spawn(world, whole(2), bad(20) ? NULL : &place, bad(20) ? NULL : &made);
    }
    case 20: return ts_world_despawn(world, body);
    case 21: return ts_collider_move_to(world, whole(4), pose());
    case 22: return ts_collider_set_velocity(world, whole(4), numbers(3), numbers(3));
    case 23: return ts_collider_teleport(world, whole(4), pose());
    case 24: return ts_collider_get_pose(world, whole(4), pose());
    case 25: return ts_collider_get_impulse(world, whole(4), numbers(3), numbers(3));
    case 26: return ts_frame_move_to(world, whole(2), pose());
    case 27: {
      int32_t vertices = 0;
      ts_body_get_vertex_count(world, body, &vertices);
      return ts_body_positions(world, body, is_tame ? 0.5 : number(), bad(10) ? NULL : rows,
                               bad(3) ? below(ROOM) : 3 * (size_t)vertices);
    }
    case 28: {
      ts_mesh_info info = {sizeof info, 0, 0, 0, 0};
      const int32_t mesh = whole(3);
      ts_mesh_get_info(scene, mesh, &info);
      return ts_body_mesh(world, body, mesh, rows, one_in(10) ? NULL : normals,
                          3 * (size_t)(bad(3) ? below(400) : (uint32_t)info.vertex_count));
    }
    case 29: {
      /* Limits the cost of a frame. */
      ts_fixed_step step = {size_of(sizeof step), whole(9), (int32_t)below(9) - 2, number()};
      if (step.dt > 0.0 && step.dt < 1e-3) step.dt = 1e-3;
      return ts_world_set_fixed_step(world, bad(20) ? NULL : &step);
    }
    case 30: {
      ts_mesh_info info = {size_of(sizeof info), 0, 0, 0, 0};
      return ts_mesh_get_info(bad(10) ? next() : scene, whole(3), &info);
    }
    case 31: return ts_mesh_get_triangles(scene, whole(3), (uint32_t*)(void*)rows, 3 * below(300));
    case 32: {
      char name[8];
      return ts_scene_get_name(scene, whole(6), whole(9), bad(10) ? NULL : name, below(9));
    }
    case 33: {
      int32_t found = 0;
      return ts_scene_find(scene, whole(6), bad(10) ? NULL : "floor", bad(10) ? NULL : &found);
    }
    case 34: {
      int32_t found = 0;
      return ts_world_stable_substeps(world, number(), bad(10) ? NULL : &found);
    }
    case 35: case 36: {
      ts_shape shape;
      int32_t made = 0;
      memset(&shape, 0, sizeof shape);
      shape.struct_size = size_of(sizeof shape);
      shape.kind = whole(4);
      for (int i = 0; i < 3; ++i) shape.size[i] = number();
      shape.friction = number(), shape.restitution = number(), shape.thickness = number();
      shape.group = 1, shape.mask = whole(9);
      if (one_in(3)) return ts_sensor_add(world, bad(20) ? NULL : &shape, pose(), bad(20) ? NULL : &made);
      return ts_collider_add(world, bad(20) ? NULL : &shape, pose(), bad(20) ? NULL : &made);
    }
    case 37: return ts_collider_remove(world, whole(6));
    case 38: case 39: {
      ts_hit hit;
      memset(&hit, 0, sizeof hit);
      hit.struct_size = size_of(sizeof hit);
      if (one_in(3)) {
        ts_cast cast;
        ts_touch touch;
        const ts_pose* where = pose();
        memset(&cast, 0, sizeof cast);
        memset(&touch, 0, sizeof touch);
        cast.struct_size = size_of(sizeof cast);
        touch.struct_size = size_of(sizeof touch);
        cast.shape = whole(5), cast.targets = whole(4), cast.mask = whole(3) - 1;
        for (int i = 0; i < 3; ++i) cast.size[i] = number(), cast.direction[i] = number();
        if (where != NULL) cast.pose = *where;
        cast.reach = number();
        if (one_in(3)) return ts_world_nearest(world, numbers(3), number(), whole(4), -1, bad(20) ? NULL : &touch);
        return ts_world_cast(world, bad(20) ? NULL : &cast, bad(20) ? NULL : &touch);
      }
      if (one_in(2)) return ts_world_closest(world, numbers(3), number(), bad(20) ? NULL : &hit);
      return ts_world_raycast(world, numbers(3), numbers(3), number(), bad(20) ? NULL : &hit);
    }
    case 40: return ts_world_record_events(world, one_in(4) ? whole(140) : TS_ALL_EVENTS);
    case 41: case 42: return drain(world);
    case 43: {
      int64_t dropped = 0;
      return ts_world_dropped_events(world, bad(10) ? NULL : &dropped);
    }
    case 44: case 45: return overlap(world);
    case 46: return attach(world, body);
    case 47: return ts_body_detach(world, body, which, count);
    case 48: {
      const int is_any = one_in(3);
      if (one_in(4)) return ts_body_set_break_force(world, is_any ? body : hanging, is_any ? whole(3) : its_frame, number());
      return ts_body_get_load(world, is_any ? body : hanging, is_any ? whole(3) : its_frame, numbers(3), numbers(3));
    }
    case 49: return take_hold(world, body);
    case 50: {
      ts_grab found = 0;
      return ts_world_get_grab(world, whole(16), bad(10) ? NULL : &found);
    }
    case 51: return ts_grab_move(world, any_grab(world), numbers(3));
    case 52: return ts_grab_release(world, any_grab(world));
    case 53: return ts_grab_get_force(world, any_grab(world), numbers(3));
    case 54: return add_frame(world);
    case 55: return one_in(2) ? ts_frame_remove(world, whole(8)) : ts_frame_get_pose(world, whole(3), pose());
    case 56: return one_in(2) ? ts_world_shift_origin(world, numbers(3)) : ts_world_set_gravity(world, numbers(3));
    case 57:
      return one_in(2) ? ts_world_set_view_origin(world, numbers(3)) : ts_body_set_friction(world, body, number());
    case 58:
      if (one_in(3)) return ts_body_set_enabled(world, body, whole(2));
      if (one_in(4)) return ts_collider_set_filter(world, whole(4), whole(4), whole(4));
      if (one_in(4)) return ts_body_set_filter(world, body, whole(4), whole(4));
      if (one_in(3)) return ts_collider_set_surface_velocity(world, whole(4), numbers(3));
      return one_in(2) ? ts_world_set_friction(world, number()) : ts_collider_set_friction(world, whole(4), number());
    case 59: case 60: return join(world, body);
    case 61: return ts_joint_release(world, any_joint(world));
    case 62: return ts_joint_get_force(world, any_joint(world), numbers(3));
    case 63: return add_motor(world, body);
    case 64: return ts_motor_set_speed(world, any_motor(world), number());
    case 65: return ts_motor_set_limit(world, any_motor(world), number());
    case 66: {
      double found = 0.0;
      const ts_motor motor = any_motor(world);
      const ts_result speed = ts_motor_get_speed(world, motor, bad(10) ? NULL : &found);
      const ts_result effort = ts_motor_get_effort(world, motor, bad(10) ? NULL : &found);
      return speed != TS_OK ? speed : one_in(2) ? effort : ts_motor_remove(world, motor);
    }
    case 67: case 68: {
      const int32_t level = whole(3);
      int32_t now = -1;
      const ts_result result = ts_body_set_level(world, body, level, whole(2));
      if (result == TS_OK && (ts_body_get_level(world, body, &now) != TS_OK || now != level)) broken("another level");
      return result;
    }
    case 69: {
      int32_t found = 0;
      const ts_result count = ts_asset_get_level_count(scene, whole(3), bad(10) ? NULL : &found);
      const ts_result level = ts_mesh_get_level(scene, whole(3), bad(10) ? NULL : &found);
      return count != TS_OK ? count : level;
    }
    default: {
      double center[3];
      return ts_body_center(world, body, bad(10) ? NULL : center);
    }
  }
}

/* Handles of all bodies, grabs, joints and motors. */
static void look(ts_world world, uint64_t found[64]) {
  for (int32_t i = 0; i < 64; ++i) {
    found[i] = 0;
    if (i < 16) ts_world_get_grab(world, i, found + i);
    if (i >= 16 && i < 32) ts_world_get_body(world, i - 16, found + i);
    if (i >= 32 && i < 48) ts_world_get_joint(world, i - 32, found + i);
    if (i >= 48) ts_world_get_motor(world, i - 48, found + i);
  }
}

/* Check that a valid snapshot can be restored and that a damaged snapshot is refused. */
static void try_snapshots(ts_world world) {
  size_t size = 0;
  uint64_t before = 0, after = 0, there[64], again[64];
  if (ts_world_snapshot(world, NULL, 0, &size) != TS_OK) return;
  char* bytes = malloc(size);
  if (ts_world_snapshot(world, bytes, size - 1, &size) != TS_ERROR_SIZE) broken("a small buffer was taken");
  if (ts_world_snapshot(world, bytes, size, &size) != TS_OK) broken("no snapshot");
  ts_world_hash(world, &before);
  look(world, there);
  for (uint32_t i = below(10); i > 0; --i) one_call(world);
  if (ts_world_step(world, 0.01, 4) != TS_OK) broken("no step");
  char* other = malloc(size);
  memcpy(other, bytes, size);
  other[below((uint32_t)size)] ^= (char)(1u << below(8));
  if (ts_world_restore(world, other, size) == TS_OK) broken("a damaged snapshot was taken");
  if (ts_world_restore(world, bytes, below((uint32_t)size)) == TS_OK) broken("a snapshot that is cut off was taken");
  if (ts_world_restore(world, bytes, size) != TS_OK) broken("a snapshot was refused");
  ts_world_hash(world, &after);
  if (before != after) broken("a snapshot did not bring the state back");
  look(world, again);
  if (memcmp(there, again, sizeof there) != 0) broken("a snapshot did not bring the numbers back");
  free(bytes);
  free(other);
}

int main(int count, char** arguments) {
  if (count != 4) return 2;
  state = strtoull(arguments[3], NULL, 10) * 2654435761u + 1;
  if (ts_scene_load("", &scene) == TS_OK || ts_scene_load(NULL, &scene) == TS_OK) broken("no scene was loaded");
  if (ts_scene_load(arguments[1], NULL) == TS_OK) broken("null was taken");
  if (ts_scene_load(arguments[1], &scene) != TS_OK) broken("the scene was refused");
  for (int i = 0; i < WORLDS; ++i) {
    if (ts_world_create(scene, &worlds[i]) != TS_OK) broken("no world");
  }
  const time_t end = time(NULL) + atoi(arguments[2]);
  uint64_t calls = 0, refused = 0;
  while (time(NULL) < end) {
    const int which = (int)below(WORLDS);
    is_tame = one_in(2);
    const ts_world world = any_world();
    uint64_t before = 0, after = 0;
    ts_clock clock = {sizeof clock, 0, 0, 0, 0, 0}, later = {sizeof later, 0, 0, 0, 0, 0};
    const ts_result is_there = ts_world_hash(world, &before);
    ts_world_get_clock(world, &clock);
    const ts_result result = one_call(world);
    ++calls;
    if (result > 0 || result < TS_ERROR_RUNTIME) broken("no code of ours");
    if (result == TS_ERROR_RUNTIME) broken("the runtime has failed");
    if (result != TS_OK) {
      ++refused;
      if (ts_last_error()[0] == 0) broken("an error without a text");
      if (is_there == TS_OK) {
        ts_world_hash(world, &after);
        ts_world_get_clock(world, &later);
        if (before != after || memcmp(&clock, &later, sizeof clock) != 0) broken("a refused call has changed the world");
      }
    }
    if (one_in(300)) try_snapshots(worlds[which]);
    if (one_in(400)) {
      const ts_world gone = worlds[which];
      if (ts_world_destroy(gone) != TS_OK) broken("a world was not destroyed");
      if (ts_world_destroy(gone) != TS_ERROR_HANDLE) broken("a world was destroyed twice");
      if (ts_world_step(gone, 0.01, 1) != TS_ERROR_HANDLE) broken("a world moves that was destroyed");
      if (ts_world_create(scene, &worlds[which]) != TS_OK) broken("no world");
    }
  }
  for (int i = 0; i < WORLDS; ++i) ts_world_destroy(worlds[i]);
  if (ts_scene_unload(scene) != TS_OK || ts_scene_unload(scene) != TS_ERROR_HANDLE) broken("unloading");
  printf("%" PRIu64 " calls, %" PRIu64 " refused\n", calls, refused);
  return 0;
}
