/* taichi-soft without Python: worlds that `taichi-soft export` wrote, stepped by a C library.
 *
 *     ts_scene scene = 0;
 *     ts_world world = 0;
 *     ts_scene_load("game.softworld", &scene);
 *     ts_world_create(scene, &world);
 *     for (;;) {
 *         ts_world_advance(world, seconds_since_last_frame, NULL);
 *         ts_body_mesh(world, body, mesh, vertices, normals, 3 * vertex_count);
 *     }
 *
 * Every function returns TS_OK, or an error below 0 with a text in ts_last_error(); then nothing was changed.
 * A handle is a number; one that was destroyed, or never was, is refused. A world takes calls of one thread at
 * a time and refuses others with TS_ERROR_BUSY; several worlds may be used by several threads at once.
 *
 * All is in the axes and the unit of length of the engine for which the world was exported: places, and lengths in
 * velocities, forces, impulses, radii. In Unreal an impulse is in kg cm/s and a moment in kg cm^2/s. Masses are in kg,
 * times in s, angles in rad; the density of air is in kg/m^3 everywhere. Turns are unit quaternions x, y, z, w.
 * Buffers are the caller's, of as many numbers as are said; nothing is kept of them. Texts are UTF-8.
 */
#ifndef TAICHI_SOFT_H
#define TAICHI_SOFT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(TAICHI_SOFT_STATIC)
#define TS_API
#elif defined(_WIN32)
#ifdef TAICHI_SOFT_BUILDS
#define TS_API __declspec(dllexport)
#else
#define TS_API __declspec(dllimport)
#endif
#else
#define TS_API __attribute__((visibility("default")))
#endif

#define TS_VERSION 1

typedef int32_t ts_result;

enum {
  TS_OK = 0,
  TS_ERROR_ARGUMENT = -1, /* a value out of range, not finite, or a null pointer */
  TS_ERROR_HANDLE = -2,   /* no such scene, world or body, or no more */
  TS_ERROR_BUSY = -3,     /* another thread is in a call of this world */
  TS_ERROR_FILE = -4,     /* a world file that is not there, not whole or damaged */
  TS_ERROR_VERSION = -5,  /* a world file or a struct of another version */
  TS_ERROR_SIZE = -6,     /* a buffer that does not fit */
  TS_ERROR_STATE = -7,    /* what the world cannot do now: a full pool, an attached body */
  TS_ERROR_SNAPSHOT = -8, /* bytes that are no snapshot of this world */
  TS_ERROR_RUNTIME = -9   /* the system has failed: memory, threads */
};

typedef uint64_t ts_scene; /* a world file in memory; 0 is none */
typedef uint64_t ts_world; /* an instance of it that moves */
typedef uint64_t ts_body;  /* who lives in a slot: another one that comes later has another number. After
                            * ts_world_restore numbers are as they were, and the same calls give the same again */
typedef uint64_t ts_grab;  /* a hand on a body, likewise */
typedef uint64_t ts_joint; /* between two bodies, likewise */
typedef uint64_t ts_motor; /* that drives a part of a body, likewise */

/* Kinds of names. The number of a TS_BODY is its slot. */
enum { TS_BODY = 0, TS_ASSET = 1, TS_COLLIDER = 2, TS_FRAME = 3, TS_MESH = 4, TS_JOINT = 5, TS_MOTOR = 6 };

enum { TS_ACTIVE = 0, TS_FROZEN = 1, TS_ASLEEP = 2 }; /* status of a body */

TS_API uint32_t ts_version(void);
/* Of the last error in this thread; "" before the first. */
TS_API const char* ts_last_error(void);

/* ---- scenes ---- */

typedef struct ts_scene_info {
  uint32_t struct_size; /* set by the caller */
  int32_t slot_count;   /* bodies that there can be at once */
  int32_t asset_count, collider_count, frame_count, mesh_count;
} ts_scene_info;

typedef struct ts_asset_info {
  uint32_t struct_size;
  int32_t vertex_count;
  int32_t slot_count; /* bodies of it that there can be at once */
  float mass;         /* of each [kg] */
} ts_asset_info;

typedef struct ts_mesh_info {
  uint32_t struct_size;
  int32_t asset;
  int32_t vertex_count, triangle_count;
  int32_t has_uv;
} ts_mesh_info;

/* Read a folder that `taichi-soft export` wrote, and open its kernels for this machine. */
TS_API ts_result ts_scene_load(const char* folder, ts_scene* scene);
/* Where a game may open no code, it is linked with it. `taichi-soft export --static` writes into the folder's `kernels`
 * an object for each platform, which has the table `taichi_soft_kernels_NAME`, NAME being the folder's without its end.
 * `world` is what its file world.tsw holds, `size` bytes; nothing is kept of it. */
typedef struct ts_linked_kernel {
  const char* name;
  void (*run)(void* context);
} ts_linked_kernel;
TS_API ts_result ts_scene_load_linked(const void* world, size_t size, const ts_linked_kernel* kernels, ts_scene* scene);
/* Its worlds go on; what it holds is given back with the last of them. */
TS_API ts_result ts_scene_unload(ts_scene scene);
TS_API ts_result ts_scene_get_info(ts_scene scene, ts_scene_info* info);
TS_API ts_result ts_scene_find(ts_scene scene, int32_t kind, const char* name, int32_t* number);
/* At most `capacity` bytes, the zero at the end included. */
TS_API ts_result ts_scene_get_name(ts_scene scene, int32_t kind, int32_t number, char* name, size_t capacity);
TS_API ts_result ts_asset_get_info(ts_scene scene, int32_t asset, ts_asset_info* info);
/* Levels of detail that it has, 1 or more. Its info is of level 0, the finest. */
TS_API ts_result ts_asset_get_level_count(ts_scene scene, int32_t asset, int32_t* count);
TS_API ts_result ts_mesh_get_info(ts_scene scene, int32_t mesh, ts_mesh_info* info);
/* The level of detail of bodies that it draws; -1 for every one, as skins do. */
TS_API ts_result ts_mesh_get_level(ts_scene scene, int32_t mesh, int32_t* level);
/* Triangles, 3 numbers each: counterclockwise seen from outside, clockwise in engines with left-handed axes. */
TS_API ts_result ts_mesh_get_triangles(ts_scene scene, int32_t mesh, uint32_t* indices, size_t count);
/* Texture coordinates, 2 numbers each, v upwards. */
TS_API ts_result ts_mesh_get_uv(ts_scene scene, int32_t mesh, float* uv, size_t count);

/* ---- worlds ---- */

typedef struct ts_fixed_step {
  uint32_t struct_size;
  int32_t substeps;  /* of a step; 0 for as many as are stable */
  int32_t max_steps; /* that one frame may make; time beyond is dropped */
  double dt;         /* [s] */
} ts_fixed_step;

typedef struct ts_clock {
  uint32_t struct_size;
  int32_t steps_made; /* by the last ts_world_advance */
  int64_t steps;      /* so far */
  double time;        /* simulated [s] */
  double alpha;       /* how far the picture is from the previous step to the last one, 0 to 1 */
  double dropped;     /* time dropped so far [s] */
} ts_clock;

/* Called before each step of ts_world_advance: the place to move colliders and frames, and to push. */
typedef void (*ts_before_step)(ts_world world, void* user);

/* A job of a step. Jobs of one step may wait for those with lower numbers. */
typedef void (*ts_job)(void* closure, int32_t number);
/* A host's threads: call job(closure, number) for each number from 0 to count - 1, begun in this order, by as many
 * threads as there are, and return when all have ended. One thread that calls them in turn will do. */
typedef void (*ts_run_jobs)(void* user, int32_t count, ts_job job, void* closure);

/* A world as it was exported. Worlds of one scene share their kernels: each takes its memory alone. */
TS_API ts_result ts_world_create(ts_scene scene, ts_world* world);
TS_API ts_result ts_world_destroy(ts_world world);
TS_API ts_result ts_world_set_fixed_step(ts_world world, const ts_fixed_step* step);
TS_API ts_result ts_world_on_step(ts_world world, ts_before_step function, void* user);
/* Threads of its own that a step may use, with the one that calls it: 1 to 256, by default as many as the processor
 * has. What comes out does not depend on it. */
TS_API ts_result ts_world_set_threads(ts_world world, int32_t count);
/* Let the host's threads make what a step can share, which must not call this world meanwhile; null for its own. */
TS_API ts_result ts_world_set_job_system(ts_world world, ts_run_jobs function, void* user);
/* One step of `dt` [s] in `substeps` equal parts; 0 chooses as many as are stable. */
TS_API ts_result ts_world_step(ts_world world, double dt, int32_t substeps);
/* Put in the time of a frame [s] and make the steps that are due. `clock` may be null. Where a step fails, those
 * before it were made. */
TS_API ts_result ts_world_advance(ts_world world, double seconds, ts_clock* clock);
TS_API ts_result ts_world_get_clock(ts_world world, ts_clock* clock);
TS_API ts_result ts_world_stable_substeps(ts_world world, double dt, int32_t* substeps);
TS_API ts_result ts_world_wake(ts_world world);
/* [m/s^2, in Unreal cm/s^2], from the next step on. Who sleeps wakes. */
TS_API ts_result ts_world_set_gravity(ts_world world, const double gravity[3]);
/* Coulomb's coefficient of the floor. */
TS_API ts_result ts_world_set_friction(ts_world world, double friction);
TS_API ts_result ts_world_set_wind(ts_world world, const double velocity[3], double density, double drag);
TS_API ts_result ts_world_radial_impulse(ts_world world, const double center[3], double impulse, double radius);
/* A number that tells states apart: that of Python's world in the same state. */
TS_API ts_result ts_world_hash(ts_world world, uint64_t* hash);
/* The state between two steps. With a null buffer only the size [bytes] is given, which changes with the events that are
 * recorded, with frames, colliders, joints and motors. What the picture is ahead of the last step, and what was dropped, is not in
 * it. */
TS_API ts_result ts_world_snapshot(ts_world world, void* buffer, size_t capacity, size_t* size);
TS_API ts_result ts_world_restore(ts_world world, const void* bytes, size_t size);

/* ---- what happened ---- */

enum { /* bits of ts_world_record_events, and kinds of a ts_event; those of one step come in this order */
  TS_CONTACT_BEGAN = 1, /* a body touches a collider (the floor may be one) or another body */
  TS_CONTACT_ENDED = 2, /* they have not touched for 0.05 s, or one of them was taken out */
  TS_FELL_ASLEEP = 4,
  TS_WOKE = 8,
  TS_FROZE = 16, /* it could not be computed any further, and was put back to where it was before the step */
  TS_ALL_EVENTS = 31
};

typedef struct ts_event {
  int32_t kind;
  int32_t collider; /* that it touches; -1 for another body */
  int64_t step;     /* of the world, counted from 0 */
  double time;      /* at the end of that step [s] */
  ts_body body;
  ts_body other;     /* that it touches, the one in the higher slot; 0 for a collider. Both may be gone */
  double impulse[3]; /* that `body` gave: in that step, or from the beginning of the contact to its end */
  double duration;   /* of a contact that ended [s] */
} ts_event;

/* Record events of these kinds, and no others, from the next step on; 0 for none. What touches already counts as a
 * contact that begins in that step. Contacts are seen in worlds with soft contact or colliders. In another one they are
 * refused alone, and left out beside other kinds. */
TS_API ts_result ts_world_record_events(ts_world world, int32_t kinds);
/* The oldest that wait, at most `capacity`; they do not wait any longer. `event_size` is sizeof(ts_event). */
TS_API ts_result ts_world_drain_events(ts_world world, ts_event* events, size_t event_size, size_t capacity,
                                       size_t* count);
/* How many were dropped so far: more than 10,000 waited, and the oldest went; or more pairs of bodies touched in a step
 * than there is room for, which counts once. */
TS_API ts_result ts_world_dropped_events(ts_world world, int64_t* count);

/* ---- bodies ---- */

typedef struct ts_placement {
  uint32_t struct_size;
  int32_t reserved;
  double position[3]; /* of the mesh's origin */
  double rotation[4];
  double velocity[3]; /* of the centre of mass */
  double spin[3];     /* [rad/s] */
} ts_placement;

TS_API ts_result ts_world_spawn(ts_world world, int32_t asset, const ts_placement* place, ts_body* body);
TS_API ts_result ts_world_despawn(ts_world world, ts_body body);
/* Who lives in a slot; 0 for nobody. */
TS_API ts_result ts_world_get_body(ts_world world, int32_t slot, ts_body* body);
TS_API ts_result ts_body_get_asset(ts_world world, ts_body body, int32_t* asset);
TS_API ts_result ts_body_get_status(ts_world world, ts_body body, int32_t* status);
/* Go on with more or fewer tetrahedra: a level of detail of its asset, 0 being the finest, at which it begins. Position,
 * velocity and deformation pass over. Vertices and triangles are others then. Grabs go on, and so do pins and attachments,
 * by the nearest vertices. Joints, motors and attachments for which there is none bar the change; with `release` of 1 they
 * are released. */
TS_API ts_result ts_body_set_level(ts_world world, ts_body body, int32_t level, int32_t release);
TS_API ts_result ts_body_get_level(ts_world world, ts_body body, int32_t* level);
/* At its level. */
TS_API ts_result ts_body_get_vertex_count(ts_world world, ts_body body, int32_t* count);
/* Of its vertices, 3 numbers each: after the last step, or with alpha below 1 on the way from the one before. */
TS_API ts_result ts_body_positions(ts_world world, ts_body body, double alpha, float* positions, size_t count);
/* What is drawn: places and normals of unit length, 3 numbers a vertex each. After ts_world_advance `alpha` of ts_clock
 * on the way from the step before, after ts_world_step as the last step left it. `normals` may be null. */
TS_API ts_result ts_body_mesh(ts_world world, ts_body body, int32_t mesh, float* positions, float* normals,
                              size_t count);
TS_API ts_result ts_body_center(ts_world world, ts_body body, double center[3]);
TS_API ts_result ts_body_set_velocity(ts_world world, ts_body body, const double linear[3], const double spin[3]);
/* The centre of mass to a place, with its velocity (1) or at rest (0). `turn` is added to how the body lies now. */
TS_API ts_result ts_body_teleport(ts_world world, ts_body body, const double center[3], const double turn[4],
                                  int32_t keeps_velocity);
/* Of a list of vertices; a count of 0 stands for all. */
TS_API ts_result ts_body_apply_impulse(ts_world world, ts_body body, const double impulse[3],
                                       const int32_t* vertices, size_t count);
TS_API ts_result ts_body_apply_force(ts_world world, ts_body body, const double force[3], const int32_t* vertices,
                                     size_t count);
TS_API ts_result ts_body_impulse_at(ts_world world, ts_body body, const double impulse[3], const double point[3],
                                    double radius);
TS_API ts_result ts_body_set_gravity_scale(ts_world world, ts_body body, double scale);
/* Coulomb's coefficient against other bodies, in worlds with soft contact: of two the geometric mean counts. */
TS_API ts_result ts_body_set_friction(ts_world world, ts_body body, double friction);
TS_API ts_result ts_body_set_damping(ts_world world, ts_body body, double rate);
TS_API ts_result ts_body_set_sheltered(ts_world world, ts_body body, int32_t is_sheltered);
TS_API ts_result ts_body_pin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
TS_API ts_result ts_body_unpin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* Where pinned vertices are after the coming step, 3 numbers each. */
TS_API ts_result ts_body_set_targets(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                     const float* targets);
/* Let vertices go with a frame, from where both are now. `feels` of 1: ts_body_get_load is asked later. */
TS_API ts_result ts_body_attach(ts_world world, ts_body body, const int32_t* vertices, size_t count, int32_t frame,
                                int32_t feels);
/* Let vertices go that hang from a frame, with the velocity that they had; a count of 0 stands for all that do. */
TS_API ts_result ts_body_detach(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* What it pulled a frame with that it hangs from, mean over the last step [N, in Unreal kg cm/s^2], and the torque of that
 * about the frame's origin. Either may be null. */
TS_API ts_result ts_body_get_load(ts_world world, ts_body body, int32_t frame, double force[3], double torque[3]);

typedef struct ts_pull {
  uint32_t struct_size;
  int32_t triangle;  /* of the body's own surface: that of a ts_hit */
  double weights[3]; /* of its vertices; 0 or more, their sum is 1 */
  double point[3];   /* to which it is pulled at first */
  double frequency;  /* of the spring [Hz]: 5 is a hand */
  double max_force;  /* [N, in Unreal kg cm/s^2]; below 0 for ten times the body's weight on Earth */
} ts_pull;

/* Take hold of a body's surface. There can be 16 grabs at a time. */
TS_API ts_result ts_body_grab(ts_world world, ts_body body, const ts_pull* pull, ts_grab* grab);
/* The grab with a number from 0 to 15; 0 if there is none. Grabs of the exported world are among them. */
TS_API ts_result ts_world_get_grab(ts_world world, int32_t number, ts_grab* grab);
TS_API ts_result ts_grab_move(ts_world world, ts_grab grab, const double point[3]);
TS_API ts_result ts_grab_release(ts_world world, ts_grab grab);
/* With what it pulls, in the last substep [N, in Unreal kg cm/s^2]. */
TS_API ts_result ts_grab_get_force(ts_world world, ts_grab grab, double force[3]);

/* ---- joints and motors, in worlds that are made for contact. Those of a body that is taken out end with it ---- */

/* Let vertices of a body be held by another one: where they are in it now, or with `onto`, which may be null, each at a
 * vertex of `other`. There can be 64 joints at a time, which hold 2,048 vertices together. */
TS_API ts_result ts_body_join(ts_world world, ts_body body, const int32_t* vertices, size_t count, ts_body other,
                              const int32_t* onto, ts_joint* joint);
/* The joint with a number from 0 to 63; 0 if there is none. Joints of the exported world are among them. */
TS_API ts_result ts_world_get_joint(ts_world world, int32_t number, ts_joint* joint);
TS_API ts_result ts_joint_release(ts_world world, ts_joint joint);
/* With what `other` pulls `body`, mean over the last step [N, in Unreal kg cm/s^2]. */
TS_API ts_result ts_joint_get_force(ts_world world, ts_joint joint, double force[3]);

typedef struct ts_drive {
  uint32_t struct_size;
  int32_t turns;     /* 1: it turns vertices about the axis; 0: it pushes them along it */
  int32_t is_fixed;  /* 1: the axis stays as it is in space; 0: it turns with the vertices */
  int32_t has_point; /* 1: it goes through `point`; 0: through the centre of the vertices */
  double axis[3];    /* of any length but 0 */
  double point[3];   /* only where it turns and is fixed */
  double speed;      /* wanted [rad/s, or the unit of length/s] */
  double limit;      /* of torque [N m, in Unreal kg cm^2/s^2], or of force [N, in Unreal kg cm/s^2] */
} ts_drive;

/* There can be 64 motors at a time, which drive 16,384 vertices together. */
TS_API ts_result ts_body_add_motor(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                   const ts_drive* drive, ts_motor* motor);
/* The motor with a number from 0 to 63; 0 if there is none. Motors of the exported world are among them. */
TS_API ts_result ts_world_get_motor(ts_world world, int32_t number, ts_motor* motor);
TS_API ts_result ts_motor_set_speed(ts_world world, ts_motor motor, double speed);
/* With 0 the vertices coast. */
TS_API ts_result ts_motor_set_limit(ts_world world, ts_motor motor, double limit);
TS_API ts_result ts_motor_remove(ts_world world, ts_motor motor);
/* That its vertices have, after the last step. */
TS_API ts_result ts_motor_get_speed(ts_world world, ts_motor motor, double* speed);
/* Torque or force that it gave, mean over the last step. */
TS_API ts_result ts_motor_get_effort(ts_world world, ts_motor motor, double* effort);

/* ---- questions ---- */

typedef struct ts_pose {
  double position[3];
  double rotation[4];
} ts_pose;

typedef struct ts_hit {
  uint32_t struct_size;
  int32_t triangle; /* of the body's own surface, not of a mesh that it carries; -1 for a body without any */
  ts_body body;     /* 0 where there is nothing; then nothing else is written */
  double distance;
  double weights[3]; /* of the three vertices; their sum is 1 */
  double point[3], normal[3]; /* the latter of unit length, outward */
  int32_t vertices[3];
  int32_t is_inside; /* of the nearest point: whether the point asked for lies in the body */
} ts_hit;

/* The first surface on a ray, back faces left out. `reach`, the farthest distance, may be infinite. */
TS_API ts_result ts_world_raycast(ts_world world, const double origin[3], const double direction[3],
                                  double reach, ts_hit* hit);
/* The nearest point of all surfaces. */
TS_API ts_result ts_world_closest(ts_world world, const double point[3], double reach, ts_hit* hit);
/* Bodies that touch a sphere, or enclose it, by slot. `capacity` as many as there are slots is always enough. */
TS_API ts_result ts_world_overlap_sphere(ts_world world, const double center[3], double radius, ts_body* bodies,
                                         size_t capacity, size_t* count);
/* The same for a box with edges of `size`. */
TS_API ts_result ts_world_overlap_box(ts_world world, const ts_pose* pose, const double size[3], ts_body* bodies,
                                      size_t capacity, size_t* count);

/* ---- colliders and frames, by their numbers in the scene ---- */

enum { TS_PLANE = 0, TS_SPHERE = 1, TS_BOX = 2, TS_CAPSULE = 3 }; /* kinds of shapes */

typedef struct ts_shape {
  uint32_t struct_size;
  int32_t kind;
  double size[3];     /* edges of a box; radius of a sphere; radius and length between the centres of a capsule,
                         which lies along the axis that is up; of a plane, whose solid is below it, nothing */
  double friction;    /* Coulomb's, 0.5 as a rule */
  double restitution; /* 0 to 1; below 0 for the bodies' own */
  double thickness;   /* how far outside of the shape bodies meet it */
  int32_t group, mask; /* bits: bodies and colliders touch where each one's mask has a bit of the other's group;
                          1 and -1 as a rule */
} ts_shape;

/* A new one, where the world was made with `collider_room`. Its number is the lowest that is free. */
TS_API ts_result ts_collider_add(ts_world world, const ts_shape* shape, const ts_pose* pose, int32_t* collider);
/* A later one may get its number. */
TS_API ts_result ts_collider_remove(ts_world world, int32_t collider);
/* Be there at the end of the coming step, and push who is in the way. */
TS_API ts_result ts_collider_move_to(ts_world world, int32_t collider, const ts_pose* pose);
TS_API ts_result ts_collider_set_velocity(ts_world world, int32_t collider, const double linear[3],
                                          const double spin[3]);
TS_API ts_result ts_collider_teleport(ts_world world, int32_t collider, const ts_pose* pose);
/* Coulomb's coefficient, from the next step on. Who sleeps near it wakes. */
TS_API ts_result ts_collider_set_friction(ts_world world, int32_t collider, double friction);
TS_API ts_result ts_collider_get_pose(ts_world world, int32_t collider, ts_pose* pose);
/* What bodies gave it in the last step, and the moment of that about its place. Either may be null. */
TS_API ts_result ts_collider_get_impulse(ts_world world, int32_t collider, double impulse[3], double moment[3]);
/* A place that moves as the game says: a bone, a vehicle, a hand. Its number is the lowest that is free. */
TS_API ts_result ts_frame_add(ts_world world, const ts_pose* pose, int32_t* frame);
/* What hangs from it is let go. A later one may get its number. */
TS_API ts_result ts_frame_remove(ts_world world, int32_t frame);
/* Be there at the end of the coming step, with what hangs from it. */
TS_API ts_result ts_frame_move_to(ts_world world, int32_t frame, const ts_pose* pose);
TS_API ts_result ts_frame_get_pose(ts_world world, int32_t frame, ts_pose* pose);

#ifdef __cplusplus
}
#endif
#endif
