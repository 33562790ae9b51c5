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
 * Every function returns TS_OK, or an error below 0 with a text in ts_last_error(). After an error, nothing is changed.
 * A handle is a number; a destroyed or unknown handle is refused. Only one thread at a time can call a world; calls of
 * other threads return TS_ERROR_BUSY. Different threads can use different worlds at the same time.
 *
 * All quantities use the axes and the unit of length of the engine for which the world was exported: positions,
 * velocities, forces, impulses, radii. In Unreal an impulse is in kg cm/s and a moment in kg cm^2/s. Masses are in kg,
 * times in s, angles in rad; the density of air is always in kg/m^3. Rotations are unit quaternions x, y, z, w.
 * The caller owns all buffers and passes their size in numbers; the library keeps no pointers to them. Text is UTF-8.
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
  TS_ERROR_HANDLE = -2,   /* an unknown or destroyed scene, world or body */
  TS_ERROR_BUSY = -3,     /* another thread is in a call of this world */
  TS_ERROR_FILE = -4,     /* a world file that is missing, incomplete or damaged */
  TS_ERROR_VERSION = -5,  /* a world file or a struct of another version */
  TS_ERROR_SIZE = -6,     /* a buffer of the wrong size */
  TS_ERROR_STATE = -7,    /* a call that the current state does not allow: a full pool, an attached body */
  TS_ERROR_SNAPSHOT = -8, /* bytes that are not a snapshot of this world */
  TS_ERROR_RUNTIME = -9   /* a failure of the system: memory, threads */
};

typedef uint64_t ts_scene; /* a world file in memory; 0 is none */
typedef uint64_t ts_world; /* a running instance of a scene */
typedef uint64_t ts_body;  /* the body in a slot; a later body in the slot has another handle. ts_world_restore
                            * restores handles too, so that repeated calls return the same handles again */
typedef uint64_t ts_grab;  /* a grab of a body, likewise */
typedef uint64_t ts_joint; /* a joint between two bodies, likewise */
typedef uint64_t ts_motor; /* a motor on a part of a body, likewise */

/* Kinds of names. The number of a TS_BODY is its slot. */
enum { TS_BODY = 0, TS_ASSET = 1, TS_COLLIDER = 2, TS_FRAME = 3, TS_MESH = 4, TS_JOINT = 5, TS_MOTOR = 6 };

enum { TS_ACTIVE = 0, TS_FROZEN = 1, TS_ASLEEP = 2 }; /* status of a body */

TS_API uint32_t ts_version(void);
/* Text of the last error in this thread; "" before the first. */
TS_API const char* ts_last_error(void);

/* ---- scenes ---- */

typedef struct ts_scene_info {
  uint32_t struct_size; /* set by the caller */
  int32_t slot_count;   /* largest number of bodies */
  int32_t asset_count, collider_count, frame_count, mesh_count;
} ts_scene_info;

typedef struct ts_asset_info {
  uint32_t struct_size;
  int32_t vertex_count;
  int32_t slot_count; /* largest number of its bodies */
  float mass;         /* of a body [kg] */
} ts_asset_info;

typedef struct ts_mesh_info {
  uint32_t struct_size;
  int32_t asset;
  int32_t vertex_count, triangle_count;
  int32_t has_uv;
} ts_mesh_info;

/* Read a folder from `taichi-soft export`, and load its kernels for this machine. */
TS_API ts_result ts_scene_load(const char* folder, ts_scene* scene);
/* For systems that forbid loading code: link the kernels into the game. `taichi-soft export --static` writes an object
 * per platform into the folder's `kernels`, with the table `taichi_soft_kernels_NAME`; NAME is the folder's name
 * without suffix. `world` is the content of world.tsw, `size` bytes; the library copies it. */
typedef struct ts_linked_kernel {
  const char* name;
  void (*run)(void* context);
} ts_linked_kernel;
TS_API ts_result ts_scene_load_linked(const void* world, size_t size, const ts_linked_kernel* kernels, ts_scene* scene);
/* Existing worlds stay valid; the memory is released with the last of them. */
TS_API ts_result ts_scene_unload(ts_scene scene);
TS_API ts_result ts_scene_get_info(ts_scene scene, ts_scene_info* info);
TS_API ts_result ts_scene_find(ts_scene scene, int32_t kind, const char* name, int32_t* number);
/* At most `capacity` bytes, including the terminating zero. */
TS_API ts_result ts_scene_get_name(ts_scene scene, int32_t kind, int32_t number, char* name, size_t capacity);
TS_API ts_result ts_asset_get_info(ts_scene scene, int32_t asset, ts_asset_info* info);
/* Number of levels of detail, 1 or more. ts_asset_info describes level 0, the finest. */
TS_API ts_result ts_asset_get_level_count(ts_scene scene, int32_t asset, int32_t* count);
TS_API ts_result ts_mesh_get_info(ts_scene scene, int32_t mesh, ts_mesh_info* info);
/* Level of detail that a mesh belongs to; -1 for a skin, which fits every level. */
TS_API ts_result ts_mesh_get_level(ts_scene scene, int32_t mesh, int32_t* level);
/* Triangles, 3 numbers each: counterclockwise seen from outside, clockwise in engines with left-handed axes. */
TS_API ts_result ts_mesh_get_triangles(ts_scene scene, int32_t mesh, uint32_t* indices, size_t count);
/* Texture coordinates, 2 numbers each, v upwards. */
TS_API ts_result ts_mesh_get_uv(ts_scene scene, int32_t mesh, float* uv, size_t count);

/* ---- worlds ---- */

typedef struct ts_fixed_step {
  uint32_t struct_size;
  int32_t substeps;  /* per step; 0 chooses a stable number */
  int32_t max_steps; /* largest number of steps per frame; further time is dropped */
  double dt;         /* [s] */
} ts_fixed_step;

typedef struct ts_clock {
  uint32_t struct_size;
  int32_t steps_made; /* by the last ts_world_advance */
  int64_t steps;      /* total */
  double time;        /* simulated time [s] */
  double alpha;       /* interpolation between the previous step and the last one, 0 to 1 */
  double dropped;     /* total dropped time [s] */
} ts_clock;

/* Called before each step of ts_world_advance. Move colliders and frames and apply forces here. */
typedef void (*ts_before_step)(ts_world world, void* user);

/* A job of a step. A job can wait for jobs of the same step with lower numbers. */
typedef void (*ts_job)(void* closure, int32_t number);
/* The host's job system: call job(closure, number) for each number from 0 to count - 1, started in this order on any
 * number of threads, and return when all have ended. Calling them in order on one thread is valid. */
typedef void (*ts_run_jobs)(void* user, int32_t count, ts_job job, void* closure);

/* Create a world in its exported state. Worlds of one scene share kernels; each needs only its own memory. */
TS_API ts_result ts_world_create(ts_scene scene, ts_world* world);
TS_API ts_result ts_world_destroy(ts_world world);
TS_API ts_result ts_world_set_fixed_step(ts_world world, const ts_fixed_step* step);
TS_API ts_result ts_world_on_step(ts_world world, ts_before_step function, void* user);
/* Number of threads for a step, including the calling one: 1 to 256, by default the number of CPU threads. Results do
 * not depend on it. */
TS_API ts_result ts_world_set_threads(ts_world world, int32_t count);
/* Run a step's jobs on the host's threads, which must not call this world meanwhile; null uses the world's threads. */
TS_API ts_result ts_world_set_job_system(ts_world world, ts_run_jobs function, void* user);
/* Make one step of `dt` [s] with `substeps` equal substeps; 0 chooses a stable number. */
TS_API ts_result ts_world_step(ts_world world, double dt, int32_t substeps);
/* Add the time of a frame [s] and make the steps that are due. `clock` can be null. If a step fails, the steps before
 * it were made. */
TS_API ts_result ts_world_advance(ts_world world, double seconds, ts_clock* clock);
TS_API ts_result ts_world_get_clock(ts_world world, ts_clock* clock);
TS_API ts_result ts_world_stable_substeps(ts_world world, double dt, int32_t* substeps);
TS_API ts_result ts_world_wake(ts_world world);
/* Gravity [m/s^2, in Unreal cm/s^2], from the next step on. Sleeping bodies wake. */
TS_API ts_result ts_world_set_gravity(ts_world world, const double gravity[3]);
/* Coulomb coefficient of the floor. */
TS_API ts_result ts_world_set_friction(ts_world world, double friction);
TS_API ts_result ts_world_set_wind(ts_world world, const double velocity[3], double density, double drag);
TS_API ts_result ts_world_radial_impulse(ts_world world, const double center[3], double impulse, double radius);
/* Hash of the state; equal to that of Python's world in the same state. */
TS_API ts_result ts_world_hash(ts_world world, uint64_t* hash);
/* Copy the state between two steps. With a null buffer, only the size [bytes] is returned; it depends on recorded
 * events, frames, colliders, joints and motors. A snapshot does not contain `alpha` and the dropped time. */
TS_API ts_result ts_world_snapshot(ts_world world, void* buffer, size_t capacity, size_t* size);
TS_API ts_result ts_world_restore(ts_world world, const void* bytes, size_t size);

/* ---- events ---- */

enum { /* bits of ts_world_record_events, and kinds of a ts_event; events of one step have this order */
  TS_CONTACT_BEGAN = 1, /* a body touches a collider (such as the floor) or another body */
  TS_CONTACT_ENDED = 2, /* they have not touched for 0.05 s, or one of them was removed */
  TS_FELL_ASLEEP = 4,
  TS_WOKE = 8,
  TS_FROZE = 16, /* the body became invalid, and was frozen in its state before the step */
  TS_ALL_EVENTS = 31
};

typedef struct ts_event {
  int32_t kind;
  int32_t collider; /* collider that the body touches; -1 for another body */
  int64_t step;     /* step of the world, from 0 */
  double time;      /* at the end of that step [s] */
  ts_body body;
  ts_body other;     /* body that it touches, in the higher slot; 0 for a collider. Both may have been removed */
  double impulse[3]; /* impulse that `body` exerted: in that step, or during the whole contact if it ended */
  double duration;   /* of a contact that ended [s] */
} ts_event;

/* Record only events of these kinds from the next step on; 0 for none. Existing contacts count as beginning in that
 * step. Contact events need soft contact or colliders. In other worlds they are refused alone, and ignored together
 * with other kinds. */
TS_API ts_result ts_world_record_events(ts_world world, int32_t kinds);
/* Remove and return the oldest waiting events, at most `capacity`. `event_size` is sizeof(ts_event). */
TS_API ts_result ts_world_drain_events(ts_world world, ts_event* events, size_t event_size, size_t capacity,
                                       size_t* count);
/* Total number of dropped events. The oldest are dropped if more than 10,000 wait. If more pairs of bodies touch in a
 * step than there is room for, this counts as one. */
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
/* Body in a slot; 0 if the slot is empty. */
TS_API ts_result ts_world_get_body(ts_world world, int32_t slot, ts_body* body);
TS_API ts_result ts_body_get_asset(ts_world world, ts_body body, int32_t* asset);
TS_API ts_result ts_body_get_status(ts_world world, ts_body body, int32_t* status);
/* Change the level of detail; 0 is the finest, at which a body is spawned. Position, velocity and deformation carry
 * over. Vertices and triangles change. Grabs continue; pins and attachments move to the nearest vertices. Joints, motors
 * and attachments that cannot be kept make the call fail, or are released if `release` is 1. */
TS_API ts_result ts_body_set_level(ts_world world, ts_body body, int32_t level, int32_t release);
TS_API ts_result ts_body_get_level(ts_world world, ts_body body, int32_t* level);
/* Number of vertices at the body's level. */
TS_API ts_result ts_body_get_vertex_count(ts_world world, ts_body body, int32_t* count);
/* Positions of its vertices, 3 numbers each, interpolated from the previous step (alpha 0) to the last one (1). */
TS_API ts_result ts_body_positions(ts_world world, ts_body body, double alpha, float* positions, size_t count);
/* Positions and unit normals to draw, 3 numbers per vertex each. After ts_world_advance they are interpolated by
 * `alpha` of ts_clock; after ts_world_step they are those of the last step. `normals` can be null. */
TS_API ts_result ts_body_mesh(ts_world world, ts_body body, int32_t mesh, float* positions, float* normals,
                              size_t count);
TS_API ts_result ts_body_center(ts_world world, ts_body body, double center[3]);
TS_API ts_result ts_body_set_velocity(ts_world world, ts_body body, const double linear[3], const double spin[3]);
/* Move the centre of mass to a position, keeping the velocity (1) or at rest (0). `turn` rotates the current shape. */
TS_API ts_result ts_body_teleport(ts_world world, ts_body body, const double center[3], const double turn[4],
                                  int32_t keeps_velocity);
/* Apply an impulse to a list of vertices; a count of 0 means all. */
TS_API ts_result ts_body_apply_impulse(ts_world world, ts_body body, const double impulse[3],
                                       const int32_t* vertices, size_t count);
TS_API ts_result ts_body_apply_force(ts_world world, ts_body body, const double force[3], const int32_t* vertices,
                                     size_t count);
TS_API ts_result ts_body_impulse_at(ts_world world, ts_body body, const double impulse[3], const double point[3],
                                    double radius);
TS_API ts_result ts_body_set_gravity_scale(ts_world world, ts_body body, double scale);
/* Coulomb coefficient against other bodies, in worlds with soft contact. Pairs use the geometric mean. */
TS_API ts_result ts_body_set_friction(ts_world world, ts_body body, double friction);
TS_API ts_result ts_body_set_damping(ts_world world, ts_body body, double rate);
TS_API ts_result ts_body_set_sheltered(ts_world world, ts_body body, int32_t is_sheltered);
TS_API ts_result ts_body_pin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
TS_API ts_result ts_body_unpin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* Positions of pinned vertices after the next step, 3 numbers each. */
TS_API ts_result ts_body_set_targets(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                     const float* targets);
/* Attach vertices to a frame at their current positions. Set `feels` to 1 to use ts_body_get_load later. */
TS_API ts_result ts_body_attach(ts_world world, ts_body body, const int32_t* vertices, size_t count, int32_t frame,
                                int32_t feels);
/* Detach vertices from their frames; they keep their velocity. A count of 0 means all attached vertices. */
TS_API ts_result ts_body_detach(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* Force of the body on a frame that it is attached to, mean over the last step [N, in Unreal kg cm/s^2], and its torque
 * about the frame's origin. Both pointers can be null. */
TS_API ts_result ts_body_get_load(ts_world world, ts_body body, int32_t frame, double force[3], double torque[3]);

typedef struct ts_pull {
  uint32_t struct_size;
  int32_t triangle;  /* of the body's surface, as in ts_hit */
  double weights[3]; /* of its vertices; 0 or more, with sum 1 */
  double point[3];   /* initial target */
  double frequency;  /* of the spring [Hz]; 5 feels like a hand */
  double max_force;  /* [N, in Unreal kg cm/s^2]; below 0 for ten times the body's weight on Earth */
} ts_pull;

/* Grab a body's surface. A world has at most 16 grabs. */
TS_API ts_result ts_body_grab(ts_world world, ts_body body, const ts_pull* pull, ts_grab* grab);
/* Grab by its index, 0 to 15, or 0 if there is none. This includes grabs of the exported world. */
TS_API ts_result ts_world_get_grab(ts_world world, int32_t number, ts_grab* grab);
TS_API ts_result ts_grab_move(ts_world world, ts_grab grab, const double point[3]);
TS_API ts_result ts_grab_release(ts_world world, ts_grab grab);
/* Force of the grab in the last substep [N, in Unreal kg cm/s^2]. */
TS_API ts_result ts_grab_get_force(ts_world world, ts_grab grab, double force[3]);

/* ---- joints and motors, in worlds with contact. They are removed together with their body ---- */

/* Attach vertices of a body to another body: at their current positions in it, or each to a vertex of `other` given by
 * `onto`, which can be null. A world has at most 64 joints with 2,048 vertices in total. */
TS_API ts_result ts_body_join(ts_world world, ts_body body, const int32_t* vertices, size_t count, ts_body other,
                              const int32_t* onto, ts_joint* joint);
/* Joint by its index, 0 to 63, or 0 if there is none. This includes joints of the exported world. */
TS_API ts_result ts_world_get_joint(ts_world world, int32_t number, ts_joint* joint);
TS_API ts_result ts_joint_release(ts_world world, ts_joint joint);
/* Force of `other` on `body`, mean over the last step [N, in Unreal kg cm/s^2]. */
TS_API ts_result ts_joint_get_force(ts_world world, ts_joint joint, double force[3]);

typedef struct ts_drive {
  uint32_t struct_size;
  int32_t turns;     /* 1: rotates vertices about the axis; 0: pushes them along it */
  int32_t is_fixed;  /* 1: the axis is fixed in space; 0: it rotates with the vertices */
  int32_t has_point; /* 1: the axis passes through `point`; 0: through the centre of the vertices */
  double axis[3];    /* of any nonzero length */
  double point[3];   /* only if `turns` and `is_fixed` are 1 */
  double speed;      /* target speed [rad/s, or the unit of length/s] */
  double limit;      /* of torque [N m, in Unreal kg cm^2/s^2], or of force [N, in Unreal kg cm/s^2] */
} ts_drive;

/* A world has at most 64 motors with 16,384 vertices in total. */
TS_API ts_result ts_body_add_motor(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                   const ts_drive* drive, ts_motor* motor);
/* Motor by its index, 0 to 63, or 0 if there is none. This includes motors of the exported world. */
TS_API ts_result ts_world_get_motor(ts_world world, int32_t number, ts_motor* motor);
TS_API ts_result ts_motor_set_speed(ts_world world, ts_motor motor, double speed);
/* Limit of torque or force; with 0 the vertices coast. */
TS_API ts_result ts_motor_set_limit(ts_world world, ts_motor motor, double limit);
TS_API ts_result ts_motor_remove(ts_world world, ts_motor motor);
/* Speed of its vertices after the last step. */
TS_API ts_result ts_motor_get_speed(ts_world world, ts_motor motor, double* speed);
/* Torque or force of the motor, mean over the last step. */
TS_API ts_result ts_motor_get_effort(ts_world world, ts_motor motor, double* effort);

/* ---- queries ---- */

typedef struct ts_pose {
  double position[3];
  double rotation[4];
} ts_pose;

typedef struct ts_hit {
  uint32_t struct_size;
  int32_t triangle; /* of the body's surface, not of a mesh; -1 for a body without triangles */
  ts_body body;     /* 0 if nothing was hit; then the other fields are unchanged */
  double distance;
  double weights[3]; /* of the three vertices, with sum 1 */
  double point[3], normal[3]; /* the normal has unit length and points outward */
  int32_t vertices[3];
  int32_t is_inside; /* ts_world_closest: 1 if the given point is inside the body */
} ts_hit;

/* First surface on a ray, without back faces. `reach` is the largest distance and can be infinite. */
TS_API ts_result ts_world_raycast(ts_world world, const double origin[3], const double direction[3],
                                  double reach, ts_hit* hit);
/* Closest point of all surfaces. */
TS_API ts_result ts_world_closest(ts_world world, const double point[3], double reach, ts_hit* hit);
/* Bodies that touch or enclose a sphere, by slot. A `capacity` of the number of slots is always enough. */
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
  double size[3];     /* box: edges; sphere: radius; capsule: radius, and length between the centres along the up axis;
                         plane: unused, its solid is below it */
  double friction;    /* Coulomb coefficient, usually 0.5 */
  double restitution; /* 0 to 1; below 0 uses that of the bodies */
  double thickness;   /* distance outside the shape at which contact begins */
  int32_t group, mask; /* bits: a body and a collider collide if the mask of each has a bit of the other's group;
                          usually 1 and -1 */
} ts_shape;

/* Add a collider, if the world has room: `World(collider_room=...)`. It gets the lowest free number. */
TS_API ts_result ts_collider_add(ts_world world, const ts_shape* shape, const ts_pose* pose, int32_t* collider);
/* Remove a collider. A later collider can get its number. */
TS_API ts_result ts_collider_remove(ts_world world, int32_t collider);
/* Move the collider to a pose over the next step, pushing bodies on the way. */
TS_API ts_result ts_collider_move_to(ts_world world, int32_t collider, const ts_pose* pose);
TS_API ts_result ts_collider_set_velocity(ts_world world, int32_t collider, const double linear[3],
                                          const double spin[3]);
TS_API ts_result ts_collider_teleport(ts_world world, int32_t collider, const ts_pose* pose);
/* Coulomb coefficient, from the next step on. Sleeping bodies nearby wake. */
TS_API ts_result ts_collider_set_friction(ts_world world, int32_t collider, double friction);
TS_API ts_result ts_collider_get_pose(ts_world world, int32_t collider, ts_pose* pose);
/* Impulse of bodies on the collider in the last step, and its moment about the collider's position. Both pointers can
 * be null. */
TS_API ts_result ts_collider_get_impulse(ts_world world, int32_t collider, double impulse[3], double moment[3]);
/* Add a frame, a pose that the game moves: a bone, a vehicle, a hand. It gets the lowest free number. */
TS_API ts_result ts_frame_add(ts_world world, const ts_pose* pose, int32_t* frame);
/* Remove a frame and detach its vertices. A later frame can get its number. */
TS_API ts_result ts_frame_remove(ts_world world, int32_t frame);
/* Move the frame and its attached vertices to a pose over the next step. */
TS_API ts_result ts_frame_move_to(ts_world world, int32_t frame, const ts_pose* pose);
TS_API ts_result ts_frame_get_pose(ts_world world, int32_t frame, ts_pose* pose);

#ifdef __cplusplus
}
#endif
#endif
