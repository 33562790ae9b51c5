/* Plays a recorded game on a world file: play FOLDER < GAME.
 *
 * A game is a list of calls, one per line, written by tests/native/games.py. The program prints the hash of the state
 * after each step, and a hash of each result that is read. The players in other languages print the same hashes.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "taichi_soft.h"

#define MOST 65536

static char line[1 << 20];
static const char* at;

static void check(ts_result result) {
  if (result != TS_OK) {
    fprintf(stderr, "%s: error %d: %s\n", line, (int)result, ts_last_error());
    exit(1);
  }
}

static double number(void) {
  char* end;
  const double found = strtod(at, &end);
  if (end == at) {
    fprintf(stderr, "a number is missing: %s\n", line);
    exit(2);
  }
  at = end;
  return found;
}

static int32_t whole(void) { return (int32_t)number(); }

static void numbers(double* into, int count) {
  for (int i = 0; i < count; ++i) into[i] = number();
}

static size_t list(int32_t* into) {
  const size_t count = (size_t)number();
  for (size_t i = 0; i < count && i < MOST; ++i) into[i] = whole();
  return count;
}

/* FNV-1a over words of 4 bytes. */
static uint64_t hash_of(const float* rows, size_t count) {
  uint64_t code = 14695981039346656037u;
  for (size_t i = 0; i < count; ++i) {
    uint32_t word;
    memcpy(&word, rows + i, 4);
    code = (code ^ word) * 1099511628211u;
  }
  return code;
}

static ts_scene scene;
static ts_world world;

static ts_body body(void) {
  ts_body found = 0;
  check(ts_world_get_body(world, whole(), &found));
  return found;
}

static ts_pose pose(void) {
  ts_pose found;
  numbers(found.position, 3);
  numbers(found.rotation, 4);
  return found;
}

static void print_touch(const ts_touch* touch) {
  const int is_body = touch->body != 0;
  float row[10];
  if (!is_body && touch->collider < 0) {
    printf("nothing\n");
    return;
  }
  row[0] = (float)touch->distance;
  for (int i = 0; i < 3; ++i) {
    row[1 + i] = is_body ? (float)touch->weights[i] : 0.0f;
    row[4 + i] = (float)touch->point[i];
    row[7 + i] = (float)touch->normal[i];
  }
  printf("%d %d %d %d %d %08x %016" PRIx64 "\n", is_body ? (int)(touch->body & 0xFFFFFFFFu) - 1 : -1,
         (int)touch->collider, is_body ? (int)touch->vertices[0] : -1, (int)touch->triangle, (int)touch->is_inside,
         (unsigned)(touch->depth * 1e6), hash_of(row, 10));
}

static void print_hit(const ts_hit* hit) {
  float row[10];
  if (hit->body == 0) {
    printf("nothing\n");
    return;
  }
  row[0] = (float)hit->distance;
  for (int i = 0; i < 3; ++i) {
    row[1 + i] = (float)hit->weights[i];
    row[4 + i] = (float)hit->point[i];
    row[7 + i] = (float)hit->normal[i];
  }
  printf("%d %d %d %d %016" PRIx64 "\n", (int)(hit->body & 0xFFFFFFFFu) - 1, (int)hit->vertices[0],
         (int)hit->vertices[1], (int)hit->vertices[2], hash_of(row, 10));
}

static float rows[3 * MOST], normals[3 * MOST];
static int32_t vertices[MOST], partners[MOST];
static char* kept;
static size_t kept_size;

static ts_grab grab(void) {
  ts_grab found = 0;
  check(ts_world_get_grab(world, whole(), &found));
  return found;
}

static ts_joint joint(void) {
  ts_joint found = 0;
  check(ts_world_get_joint(world, whole(), &found));
  return found;
}

static ts_motor motor(void) {
  ts_motor found = 0;
  check(ts_world_get_motor(world, whole(), &found));
  return found;
}

static int slot_of(ts_body who) { return (int)(who & 0xFFFFFFFFu) - 1; }

static void print_slots(const ts_body* found, size_t count) {
  if (count == 0) printf("nothing\n");
  for (size_t i = 0; i < count; ++i) printf(i + 1 < count ? "%d " : "%d\n", slot_of(found[i]));
}

static ts_event events[MOST];
static ts_body found_bodies[MOST];

static void play(const char* call) {
  double a[8];
#define CALL(name) else if (strcmp(call, name) == 0)
  if (strcmp(call, "step") == 0) {
    const double dt = number();
    uint64_t hash = 0;
    check(ts_world_step(world, dt, whole()));
    check(ts_world_hash(world, &hash));
    printf("%016" PRIx64 "\n", hash);
  }
  CALL("impulse") {
    const ts_body who = body();
    numbers(a, 3);
    const size_t count = list(vertices);
    check(ts_body_apply_impulse(world, who, a, vertices, count));
  }
  CALL("force") {
    const ts_body who = body();
    numbers(a, 3);
    const size_t count = list(vertices);
    check(ts_body_apply_force(world, who, a, vertices, count));
  }
  CALL("impulse_at") {
    const ts_body who = body();
    numbers(a, 6);
    check(ts_body_impulse_at(world, who, a, a + 3, number()));
  }
  CALL("radial_impulse") {
    numbers(a, 4);
    check(ts_world_radial_impulse(world, a, a[3], number()));
  }
  CALL("velocity") {
    const ts_body who = body();
    numbers(a, 6);
    check(ts_body_set_velocity(world, who, a, a + 3));
  }
  CALL("teleport") {
    const ts_body who = body();
    numbers(a, 7);
    check(ts_body_teleport(world, who, a, a + 3, whole()));
  }
  CALL("gravity_scale") {
    const ts_body who = body();
    check(ts_body_set_gravity_scale(world, who, number()));
  }
  CALL("damping") {
    const ts_body who = body();
    check(ts_body_set_damping(world, who, number()));
  }
  CALL("sheltered") {
    const ts_body who = body();
    check(ts_body_set_sheltered(world, who, whole()));
  }
  CALL("pin") {
    const ts_body who = body();
    const size_t count = list(vertices);
    check(ts_body_pin(world, who, vertices, count));
  }
  CALL("unpin") {
    const ts_body who = body();
    const size_t count = list(vertices);
    check(ts_body_unpin(world, who, vertices, count));
  }
  CALL("targets") {
    const ts_body who = body();
    const size_t count = list(vertices);
    for (size_t i = 0; i < 3 * count; ++i) rows[i] = (float)number();
    check(ts_body_set_targets(world, who, vertices, count, rows));
  }
  CALL("set_level") {
    const ts_body who = body();
    const int32_t level = whole();
    check(ts_body_set_level(world, who, level, whole()));
  }
  CALL("level") {
    const ts_body who = body();
    int32_t level = 0, count = 0;
    check(ts_body_get_level(world, who, &level));
    check(ts_body_get_vertex_count(world, who, &count));
    printf("%d %d\n", (int)level, (int)count);
  }
  CALL("wind") {
    numbers(a, 5);
    check(ts_world_set_wind(world, a, a[3], a[4]));
  }
  CALL("gravity") {
    numbers(a, 3);
    check(ts_world_set_gravity(world, a));
  }
  CALL("shift_origin") {
    numbers(a, 3);
    check(ts_world_shift_origin(world, a));
  }
  CALL("view_origin") {
    numbers(a, 3);
    check(ts_world_set_view_origin(world, a));
  }
  CALL("floor_friction") check(ts_world_set_friction(world, number()));
  CALL("body_friction") {
    const ts_body who = body();
    check(ts_body_set_friction(world, who, number()));
  }
  CALL("collider_friction") {
    const int32_t which = whole();
    check(ts_collider_set_friction(world, which, number()));
  }
  CALL("wake") check(ts_world_wake(world));
  CALL("spawn") {
    ts_placement place;
    ts_body found = 0;
    memset(&place, 0, sizeof place);
    place.struct_size = sizeof place;
    const int32_t asset = whole();
    numbers(place.position, 3);
    numbers(place.rotation, 4);
    numbers(place.velocity, 3);
    numbers(place.spin, 3);
    check(ts_world_spawn(world, asset, &place, &found));
  }
  CALL("despawn") check(ts_world_despawn(world, body()));
  CALL("raycast") {
    ts_hit hit;
    hit.struct_size = sizeof hit;
    numbers(a, 6);
    check(ts_world_raycast(world, a, a + 3, number(), &hit));
    print_hit(&hit);
  }
  CALL("closest") {
    ts_hit hit;
    hit.struct_size = sizeof hit;
    numbers(a, 3);
    check(ts_world_closest(world, a, number(), &hit));
    print_hit(&hit);
    if (hit.body != 0) printf("%d\n", (int)hit.is_inside);
  }
  CALL("cast") {
    ts_cast cast;
    ts_touch touch;
    memset(&cast, 0, sizeof cast);
    memset(&touch, 0, sizeof touch);
    cast.struct_size = sizeof cast;
    touch.struct_size = sizeof touch;
    cast.shape = whole();
    numbers(cast.size, 3);
    cast.pose = pose();
    numbers(cast.direction, 3);
    cast.reach = number();
    cast.targets = whole();
    cast.mask = whole();
    check(ts_world_cast(world, &cast, &touch));
    print_touch(&touch);
  }
  CALL("nearest") {
    ts_touch touch;
    memset(&touch, 0, sizeof touch);
    touch.struct_size = sizeof touch;
    numbers(a, 3);
    const double reach = number();
    const int32_t targets = whole();
    check(ts_world_nearest(world, a, reach, targets, whole(), &touch));
    print_touch(&touch);
  }
  CALL("overlap_sphere") {
    size_t count = 0;
    numbers(a, 3);
    check(ts_world_overlap_sphere(world, a, number(), found_bodies, MOST, &count));
    print_slots(found_bodies, count);
  }
  CALL("overlap_box") {
    size_t count = 0;
    const ts_pose where = pose();
    numbers(a, 3);
    check(ts_world_overlap_box(world, &where, a, found_bodies, MOST, &count));
    print_slots(found_bodies, count);
  }
  CALL("record_events") check(ts_world_record_events(world, whole()));
  CALL("drain") {
    size_t count = 0;
    check(ts_world_drain_events(world, events, sizeof(ts_event), MOST, &count));
    printf("events %d\n", (int)count);
    for (size_t i = 0; i < count; ++i) {
      const ts_event* each = events + i;
      rows[0] = (float)each->time;
      for (int k = 0; k < 3; ++k) rows[1 + k] = (float)each->impulse[k];
      rows[4] = (float)each->duration;
      printf("%d %d %d %d %d %016" PRIx64 "\n", (int)each->kind, (int)each->collider, (int)each->step,
             slot_of(each->body), slot_of(each->other), hash_of(rows, 5));
    }
  }
  CALL("attach") {
    const ts_body who = body();
    const size_t count = list(vertices);
    const int32_t frame = whole();
    check(ts_body_attach(world, who, vertices, count, frame, whole()));
  }
  CALL("detach") {
    const ts_body who = body();
    const size_t count = list(vertices);
    check(ts_body_detach(world, who, vertices, count));
  }
  CALL("load") {
    const ts_body who = body();
    check(ts_body_get_load(world, who, whole(), a, a + 3));
    for (int i = 0; i < 6; ++i) rows[i] = (float)a[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 6));
  }
  CALL("grab") {
    ts_pull pull;
    ts_grab made = 0;
    const ts_body who = body();
    memset(&pull, 0, sizeof pull);
    pull.struct_size = sizeof pull;
    pull.triangle = whole();
    numbers(pull.weights, 3);
    numbers(pull.point, 3);
    pull.frequency = number();
    pull.max_force = number();
    check(ts_body_grab(world, who, &pull, &made));
  }
  CALL("move_grab") {
    const ts_grab which = grab();
    numbers(a, 3);
    check(ts_grab_move(world, which, a));
  }
  CALL("release_grab") check(ts_grab_release(world, grab()));
  CALL("grab_force") {
    check(ts_grab_get_force(world, grab(), a));
    for (int i = 0; i < 3; ++i) rows[i] = (float)a[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 3));
  }
  CALL("join") {
    ts_joint made = 0;
    const ts_body who = body();
    const size_t count = list(vertices);
    const ts_body other = body();
    const size_t named = list(partners);
    check(ts_body_join(world, who, vertices, count, other, named == 0 ? NULL : partners, &made));
    printf("%d\n", (int)(made & 0xFFFFFFFFu) - 1);
  }
  CALL("connect") {
    ts_joint made = 0;
    const ts_body who = body(), other = body();
    const int32_t kind = whole();
    numbers(a, 6);
    check(ts_body_connect(world, who, other, kind, a, a + 3, &made));
    printf("%d\n", (int)(made & 0xFFFFFFFFu) - 1);
  }
  CALL("joint_force") {
    check(ts_joint_get_force(world, joint(), a));
    for (int i = 0; i < 3; ++i) rows[i] = (float)a[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 3));
  }
  CALL("break_attachment") {
    const ts_body who = body();
    const int32_t frame = whole();
    check(ts_body_set_break_force(world, who, frame, number()));
  }
  CALL("break_force") {
    const ts_joint which = joint();
    check(ts_joint_set_break_force(world, which, number()));
  }
  CALL("release_joint") check(ts_joint_release(world, joint()));
  CALL("add_motor") {
    ts_drive drive;
    ts_motor made = 0;
    const ts_body who = body();
    const size_t count = list(vertices);
    memset(&drive, 0, sizeof drive);
    drive.struct_size = sizeof drive;
    drive.turns = whole();
    drive.is_fixed = whole();
    drive.has_point = whole();
    numbers(drive.axis, 3);
    numbers(drive.point, 3);
    drive.speed = number();
    drive.limit = number();
    check(ts_body_add_motor(world, who, vertices, count, &drive, &made));
    printf("%d\n", (int)(made & 0xFFFFFFFFu) - 1);
  }
  CALL("motor_speed") {
    const ts_motor which = motor();
    check(ts_motor_set_speed(world, which, number()));
  }
  CALL("motor_limit") {
    const ts_motor which = motor();
    check(ts_motor_set_limit(world, which, number()));
  }
  CALL("motor_state") {
    const ts_motor which = motor();
    check(ts_motor_get_speed(world, which, a));
    check(ts_motor_get_effort(world, which, a + 1));
    for (int i = 0; i < 2; ++i) rows[i] = (float)a[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 2));
  }
  CALL("remove_motor") check(ts_motor_remove(world, motor()));
  CALL("add_frame") {
    int32_t made = 0;
    const ts_pose where = pose();
    check(ts_frame_add(world, &where, &made));
    printf("%d\n", (int)made);
  }
  CALL("remove_frame") check(ts_frame_remove(world, whole()));
  CALL("frame_pose") {
    ts_pose where;
    check(ts_frame_get_pose(world, whole(), &where));
    for (int i = 0; i < 3; ++i) rows[i] = (float)where.position[i];
    for (int i = 0; i < 4; ++i) rows[3 + i] = (float)where.rotation[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 7));
  }
  CALL("add_collider") {
    ts_shape shape;
    int32_t made = 0;
    memset(&shape, 0, sizeof shape);
    shape.struct_size = sizeof shape;
    shape.kind = whole();
    numbers(shape.size, 3);
    shape.friction = number();
    shape.restitution = number();
    shape.thickness = number();
    shape.group = whole();
    shape.mask = whole();
    const ts_pose where = pose();
    check(ts_collider_add(world, &shape, &where, &made));
    printf("%d\n", (int)made);
  }
  CALL("add_sensor") {
    ts_shape shape;
    int32_t made = 0;
    memset(&shape, 0, sizeof shape);
    shape.struct_size = sizeof shape;
    shape.kind = whole();
    numbers(shape.size, 3);
    shape.group = whole();
    shape.mask = whole();
    const ts_pose where = pose();
    check(ts_sensor_add(world, &shape, &where, &made));
    printf("%d\n", (int)made);
  }
  CALL("bodies_inside") {
    size_t count = 0;
    check(ts_sensor_get_bodies(world, whole(), found_bodies, MOST, &count));
    print_slots(found_bodies, count);
  }
  CALL("remove_collider") check(ts_collider_remove(world, whole()));
  CALL("move_collider") {
    const int32_t which = whole();
    const ts_pose where = pose();
    check(ts_collider_move_to(world, which, &where));
  }
  CALL("drive_collider") {
    const int32_t which = whole();
    numbers(a, 6);
    check(ts_collider_set_velocity(world, which, a, a + 3));
  }
  CALL("enabled") {
    const ts_body who = body();
    check(ts_body_set_enabled(world, who, whole()));
  }
  CALL("body_filter") {
    const ts_body who = body();
    const int32_t group = whole();
    check(ts_body_set_filter(world, who, group, whole()));
  }
  CALL("collider_filter") {
    const int32_t which = whole(), group = whole();
    check(ts_collider_set_filter(world, which, group, whole()));
  }
  CALL("surface_velocity") {
    const int32_t which = whole();
    numbers(a, 3);
    check(ts_collider_set_surface_velocity(world, which, a));
  }
  CALL("teleport_collider") {
    const int32_t which = whole();
    const ts_pose where = pose();
    check(ts_collider_teleport(world, which, &where));
  }
  CALL("move_frame") {
    const int32_t which = whole();
    const ts_pose where = pose();
    check(ts_frame_move_to(world, which, &where));
  }
  CALL("snapshot") {
    check(ts_world_snapshot(world, NULL, 0, &kept_size));
    free(kept);
    kept = malloc(kept_size);
    check(ts_world_snapshot(world, kept, kept_size, &kept_size));
  }
  CALL("restore") check(ts_world_restore(world, kept, kept_size));
  CALL("positions") {
    const ts_body who = body();
    int32_t vertex_count = 0;
    check(ts_body_get_vertex_count(world, who, &vertex_count));
    const size_t count = 3 * (size_t)vertex_count;
    check(ts_body_positions(world, who, number(), rows, count));
    printf("%016" PRIx64 "\n", hash_of(rows, count));
  }
  CALL("mesh") {
    ts_mesh_info info = {sizeof info, 0, 0, 0, 0};
    const ts_body who = body();
    const int32_t mesh = whole();
    check(ts_mesh_get_info(scene, mesh, &info));
    const size_t count = 3 * (size_t)info.vertex_count;
    check(ts_body_mesh(world, who, mesh, rows, normals, count));
    printf("%016" PRIx64 " %016" PRIx64 "\n", hash_of(rows, count), hash_of(normals, count));
  }
  CALL("collider_impulse") {
    check(ts_collider_get_impulse(world, whole(), a, a + 3));
    for (int i = 0; i < 6; ++i) rows[i] = (float)a[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 6));
  }
  CALL("collider_pose") {
    ts_pose where;
    check(ts_collider_get_pose(world, whole(), &where));
    for (int i = 0; i < 3; ++i) rows[i] = (float)where.position[i];
    for (int i = 0; i < 4; ++i) rows[3 + i] = (float)where.rotation[i];
    printf("%016" PRIx64 "\n", hash_of(rows, 7));
  }
  CALL("status") {
    int32_t status = 0;
    check(ts_body_get_status(world, body(), &status));
    printf("%d\n", (int)status);
  }
  CALL("stable_substeps") {
    int32_t count = 0;
    check(ts_world_stable_substeps(world, number(), &count));
    printf("%d\n", (int)count);
  }
  else {
    fprintf(stderr, "unknown call: %s\n", line);
    exit(2);
  }
}

int main(int count, char** arguments) {
  if (count != 2) {
    fprintf(stderr, "usage: play FOLDER < GAME\n");
    return 2;
  }
  check(ts_scene_load(arguments[1], &scene));
  check(ts_world_create(scene, &world));
  while (fgets(line, sizeof line, stdin) != NULL) {
    char call[32];
    int length = 0;
    line[strcspn(line, "\n")] = 0;
    if (sscanf(line, "%31s%n", call, &length) != 1) continue;
    at = line + length;
    play(call);
  }
  check(ts_world_destroy(world));
  check(ts_scene_unload(scene));
  free(kept);
  return 0;
}
