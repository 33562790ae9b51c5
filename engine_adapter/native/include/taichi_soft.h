/* taichi-soft without Python: a C library that steps worlds from `taichi-soft export`.
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
 * A handle is a number; calls with a destroyed or unknown handle are refused. Only one thread at a time can call a
 * world; calls from other threads return TS_ERROR_BUSY. Different threads can use different worlds at the same time.
 *
 * Positions, velocities, forces, impulses and radii use the axes and the unit of length of the engine for which the
 * world was exported. In Unreal an impulse is in kg cm/s and a moment in kg cm^2/s. Masses are in kg, times in s,
 * angles in rad; the density of air is always in kg/m^3. Rotations are unit quaternions x, y, z, w. The caller owns all
 * buffers and passes the number of their elements; the library keeps no pointers to buffers. Text is UTF-8.
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
  TS_ERROR_FILE = -4,     /* a missing, incomplete or damaged world file */
  TS_ERROR_VERSION = -5,  /* a world file or a struct of another version */
  TS_ERROR_SIZE = -6,     /* a buffer of the wrong size */
  TS_ERROR_STATE = -7,    /* a call that the current state does not allow: a full pool, an attached body */
  TS_ERROR_SNAPSHOT = -8, /* bytes that are not a snapshot of this world */
  TS_ERROR_RUNTIME = -9   /* a failure of the system: memory, threads */
};

typedef uint64_t ts_scene; /* a world file in memory; 0 is none */
typedef uint64_t ts_world; /* a running instance of a scene */
typedef uint64_t ts_body;  /* the body in a slot; a later body in the slot has a different handle. After
                            * ts_world_restore, repeated calls return the same handles again */
typedef uint64_t ts_grab;  /* a grab of a body; handles follow the same rules as ts_body */
typedef uint64_t ts_joint; /* a joint between two bodies; handles follow the same rules as ts_body */
typedef uint64_t ts_motor; /* a motor on a part of a body; handles follow the same rules as ts_body */

/* Kinds of named objects. The number of a TS_BODY is its slot. */
enum { TS_BODY = 0, TS_ASSET = 1, TS_COLLIDER = 2, TS_FRAME = 3, TS_MESH = 4, TS_JOINT = 5, TS_MOTOR = 6 };

enum { TS_ACTIVE = 0, TS_FROZEN = 1, TS_ASLEEP = 2, TS_DISABLED = 5 }; /* status of a body */

TS_API uint32_t ts_version(void);
/* Text of the last error in this thread; "" if there was none. */
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
  int32_t slot_count; /* largest number of bodies of this asset */
  float mass;         /* mass of a body [kg] */
} ts_asset_info;

typedef struct ts_mesh_info {
  uint32_t struct_size;
  int32_t asset;
  int32_t vertex_count, triangle_count;
  int32_t has_uv;
} ts_mesh_info;

/* Read a folder from `taichi-soft export`, and load its kernels for this machine. */
TS_API ts_result ts_scene_load(const char* folder, ts_scene* scene);
/* Load a world whose kernels are linked into the game, for systems that forbid loading code. `taichi-soft export
 * --static` writes an object file for each platform to the subfolder `kernels`. The object file contains the table
 * `taichi_soft_kernels_NAME`; NAME is the folder's name without suffix. `world` is the content of world.tsw, `size`
 * bytes, which the library copies. */
typedef struct ts_linked_kernel {
  const char* name;
  void (*run)(void* context);
} ts_linked_kernel;
TS_API ts_result ts_scene_load_linked(const void* world, size_t size, const ts_linked_kernel* kernels, ts_scene* scene);
/* Release a scene. Existing worlds stay valid; the memory is freed when the last world is destroyed. */
TS_API ts_result ts_scene_unload(ts_scene scene);
TS_API ts_result ts_scene_get_info(ts_scene scene, ts_scene_info* info);
TS_API ts_result ts_scene_find(ts_scene scene, int32_t kind, const char* name, int32_t* number);
/* Write the name of an object to `name`, at most `capacity` bytes including the terminating zero. */
TS_API ts_result ts_scene_get_name(ts_scene scene, int32_t kind, int32_t number, char* name, size_t capacity);
TS_API ts_result ts_asset_get_info(ts_scene scene, int32_t asset, ts_asset_info* info);
/* Number of levels of detail, 1 or more. ts_asset_info describes level 0, the finest. */
TS_API ts_result ts_asset_get_level_count(ts_scene scene, int32_t asset, int32_t* count);
TS_API ts_result ts_mesh_get_info(ts_scene scene, int32_t mesh, ts_mesh_info* info);
/* Level of detail for which a mesh is drawn; -1 for a skin, which is drawn at every level. */
TS_API ts_result ts_mesh_get_level(ts_scene scene, int32_t mesh, int32_t* level);
/* Triangles, 3 vertex numbers each. Seen from outside, the vertices are counterclockwise, or clockwise in engines with
 * left-handed axes. */
TS_API ts_result ts_mesh_get_triangles(ts_scene scene, int32_t mesh, uint32_t* indices, size_t count);
/* Texture coordinates, 2 numbers per vertex; v points up. */
TS_API ts_result ts_mesh_get_uv(ts_scene scene, int32_t mesh, float* uv, size_t count);

/* ---- worlds ---- */

typedef struct ts_fixed_step {
  uint32_t struct_size;
  int32_t substeps;  /* number of substeps per step; 0 chooses a stable number */
  int32_t max_steps; /* largest number of steps per frame; further time is dropped */
  double dt;         /* length of a step [s] */
} ts_fixed_step;

typedef struct ts_clock {
  uint32_t struct_size;
  int32_t steps_made; /* number of steps that the last ts_world_advance made */
  int64_t steps;      /* total number of steps */
  double time;        /* simulated time [s] */
  double alpha;       /* interpolation factor between the states before (0) and after (1) the last step */
  double dropped;     /* total dropped time [s] */
} ts_clock;

/* Called before each step of ts_world_advance. Move colliders and frames and apply forces here. */
typedef void (*ts_before_step)(ts_world world, void* user);

/* A job of a step. A job can wait for jobs of the same step with lower numbers. */
typedef void (*ts_job)(void* closure, int32_t number);
/* Function of the host's job system. The function must call job(closure, number) for each number from 0 to count - 1.
 * It must start the calls in this order, on one or more threads, and return when all calls have ended. */
typedef void (*ts_run_jobs)(void* user, int32_t count, ts_job job, void* closure);

/* Create a world in the exported state. Worlds of one scene share kernels, but each world has its own memory. */
TS_API ts_result ts_world_create(ts_scene scene, ts_world* world);
TS_API ts_result ts_world_destroy(ts_world world);
TS_API ts_result ts_world_set_fixed_step(ts_world world, const ts_fixed_step* step);
TS_API ts_result ts_world_on_step(ts_world world, ts_before_step function, void* user);
/* Set the number of threads for a step, including the calling thread: 1 to 256, by default the number of CPU threads.
 * Results do not depend on the number of threads. */
TS_API ts_result ts_world_set_threads(ts_world world, int32_t count);
/* Run the jobs of a step on the host's threads. The jobs' threads must not call this world. Null uses the world's own
 * threads. */
TS_API ts_result ts_world_set_job_system(ts_world world, ts_run_jobs function, void* user);
/* Make one step of `dt` [s] with `substeps` equal substeps; 0 chooses a stable number. */
TS_API ts_result ts_world_step(ts_world world, double dt, int32_t substeps);
/* Add the time of a frame [s] and make the steps that are due. `clock` can be null. If a step fails, earlier steps of
 * the call are not undone. */
TS_API ts_result ts_world_advance(ts_world world, double seconds, ts_clock* clock);
TS_API ts_result ts_world_get_clock(ts_world world, ts_clock* clock);
TS_API ts_result ts_world_stable_substeps(ts_world world, double dt, int32_t* substeps);
TS_API ts_result ts_world_wake(ts_world world);
/* Set gravity [m/s^2, in Unreal cm/s^2] from the next step on. Sleeping bodies wake. */
TS_API ts_result ts_world_set_gravity(ts_world world, const double gravity[3]);
/* Move the origin to `offset`: subtract it from all coordinates of the world, so that a game far from the origin computes
 * near it again. Nothing moves relative to anything else, and sleeping bodies stay asleep. */
TS_API ts_result ts_world_shift_origin(ts_world world, const double offset[3]);
/* Draw relative to a point, such as the camera: ts_body_positions and ts_body_mesh return positions minus `point`,
 * computed before they are rounded to floats. All other coordinates stay those of the world. */
TS_API ts_result ts_world_set_view_origin(ts_world world, const double point[3]);
/* Set the Coulomb coefficient of the floor. */
TS_API ts_result ts_world_set_friction(ts_world world, double friction);
TS_API ts_result ts_world_set_wind(ts_world world, const double velocity[3], double density, double drag);
TS_API ts_result ts_world_radial_impulse(ts_world world, const double center[3], double impulse, double radius);
/* Hash of the state. A world of Python in the same state has the same hash. */
TS_API ts_result ts_world_hash(ts_world world, uint64_t* hash);
/* Copy the state between two steps. If the buffer is null, the function returns only the size [bytes], which depends on
 * recorded events, frames, colliders, joints and motors. A snapshot contains neither `alpha` nor the dropped time. */
TS_API ts_result ts_world_snapshot(ts_world world, void* buffer, size_t capacity, size_t* size);
TS_API ts_result ts_world_restore(ts_world world, const void* bytes, size_t size);

/* ---- events ---- */

enum { /* bits of ts_world_record_events, and kinds of a ts_event; events of one step have this order */
  TS_CONTACT_BEGAN = 1, /* a body touches a collider (such as the floor) or another body */
  TS_CONTACT_ENDED = 2, /* two objects have not touched for 0.05 s, or one of them was removed */
  TS_FELL_ASLEEP = 4,
  TS_WOKE = 8,
  TS_FROZE = 16, /* the body became invalid, and was frozen in its state before the step */
  TS_ENTERED = 32, /* a body came into a sensor */
  TS_LEFT = 64, /* a body left a sensor, or one of the two was removed */
  TS_BROKE = 128, /* a joint or an attachment broke; `impulse` is that of `other` or of the frame on the body in the step.
                    For an attachment, `collider` is the number of the frame */
  TS_ALL_EVENTS = 255
};

typedef struct ts_event {
  int32_t kind;
  int32_t collider; /* collider that the body touches, or sensor; -1 for another body */
  int64_t step;     /* step of the world, from 0 */
  double time;      /* simulated time at the end of the step [s] */
  ts_body body;
  ts_body other;     /* body in a higher slot that `body` touches; 0 for a collider. Both can have been removed since */
  double impulse[3]; /* impulse that `body` exerted in the step, or in the whole contact if the contact ended */
  double duration;   /* duration of a contact that ended [s] */
} ts_event;

/* Record only events of these kinds from the next step on; 0 records none. Existing contacts count as beginning in the
 * next step. Contact events need soft contact or colliders. In a world without them, the call is refused if `kinds` has
 * only contact events; otherwise, contact events are ignored. */
TS_API ts_result ts_world_record_events(ts_world world, int32_t kinds);
/* Remove the oldest waiting events, and write at most `capacity` of them. `event_size` is sizeof(ts_event). */
TS_API ts_result ts_world_drain_events(ts_world world, ts_event* events, size_t event_size, size_t capacity,
                                       size_t* count);
/* Total number of dropped events. If more than 10,000 events wait, the oldest are dropped. A step in which more pairs
 * touch than the library can record counts as one dropped event. */
TS_API ts_result ts_world_dropped_events(ts_world world, int64_t* count);

/* ---- bodies ---- */

typedef struct ts_placement {
  uint32_t struct_size;
  int32_t reserved;
  double position[3]; /* position of the mesh's origin */
  double rotation[4];
  double velocity[3]; /* velocity of the centre of mass */
  double spin[3];     /* angular velocity [rad/s] */
} ts_placement;

TS_API ts_result ts_world_spawn(ts_world world, int32_t asset, const ts_placement* place, ts_body* body);
TS_API ts_result ts_world_despawn(ts_world world, ts_body body);
/* Switch a body off (0) or on (1). A body that is off keeps its handle, shape and velocity, and costs no time: it does
 * not move, and nothing touches or finds it. Its contacts end; its joints, grabs, motors and attachments pause.
 * ts_body_positions and ts_body_mesh still return its shape. */
TS_API ts_result ts_body_set_enabled(ts_world world, ts_body body, int32_t is_enabled);
/* Body in a slot; 0 if the slot is empty. */
TS_API ts_result ts_world_get_body(ts_world world, int32_t slot, ts_body* body);
TS_API ts_result ts_body_get_asset(ts_world world, ts_body body, int32_t* asset);
TS_API ts_result ts_body_get_status(ts_world world, ts_body body, int32_t* status);
/* Change the level of detail; 0 is the finest, at which a body is spawned. The body keeps its position, velocity and
 * deformation, but vertices and triangles change. Grabs continue; pins and attachments move to the nearest vertices. If
 * joints, motors or attachments cannot be kept, the call fails, or releases them if `release` is 1. */
TS_API ts_result ts_body_set_level(ts_world world, ts_body body, int32_t level, int32_t release);
TS_API ts_result ts_body_get_level(ts_world world, ts_body body, int32_t* level);
/* Number of vertices at the body's level. */
TS_API ts_result ts_body_get_vertex_count(ts_world world, ts_body body, int32_t* count);
/* Positions of the body's vertices, 3 numbers each, interpolated between the states before (alpha 0) and after (alpha
 * 1) the last step. */
TS_API ts_result ts_body_positions(ts_world world, ts_body body, double alpha, float* positions, size_t count);
/* Positions and unit normals for drawing, 3 numbers per vertex each. After ts_world_advance, both are interpolated by
 * `alpha` of ts_clock. After ts_world_step, both are from the last step. `normals` can be null. */
TS_API ts_result ts_body_mesh(ts_world world, ts_body body, int32_t mesh, float* positions, float* normals,
                              size_t count);
TS_API ts_result ts_body_center(ts_world world, ts_body body, double center[3]);
TS_API ts_result ts_body_set_velocity(ts_world world, ts_body body, const double linear[3], const double spin[3]);
/* Move the centre of mass to a position and rotate the current shape by `turn`. The body keeps its velocity if
 * `keeps_velocity` is 1; otherwise it is at rest. */
TS_API ts_result ts_body_teleport(ts_world world, ts_body body, const double center[3], const double turn[4],
                                  int32_t keeps_velocity);
/* Apply an impulse to a list of vertices; a count of 0 means all. */
TS_API ts_result ts_body_apply_impulse(ts_world world, ts_body body, const double impulse[3], const int32_t* vertices,
                                       size_t count);
TS_API ts_result ts_body_apply_force(ts_world world, ts_body body, const double force[3], const int32_t* vertices,
                                     size_t count);
TS_API ts_result ts_body_impulse_at(ts_world world, ts_body body, const double impulse[3], const double point[3],
                                    double radius);
TS_API ts_result ts_body_set_gravity_scale(ts_world world, ts_body body, double scale);
/* Set the Coulomb coefficient for contact with other bodies, in worlds with soft contact. A pair of bodies uses the
 * geometric mean of both coefficients. */
TS_API ts_result ts_body_set_friction(ts_world world, ts_body body, double friction);
/* Set group and mask from the next step on, see ts_shape. Contacts with what the body no longer touches end at once. The
 * body and sleeping bodies near it wake. */
TS_API ts_result ts_body_set_filter(ts_world world, ts_body body, int32_t group, int32_t mask);
TS_API ts_result ts_body_set_damping(ts_world world, ts_body body, double rate);
TS_API ts_result ts_body_set_sheltered(ts_world world, ts_body body, int32_t is_sheltered);
TS_API ts_result ts_body_pin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
TS_API ts_result ts_body_unpin(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* Set the positions of pinned vertices after the next step, 3 numbers each. */
TS_API ts_result ts_body_set_targets(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                     const float* targets);
/* Attach vertices to a frame at their current positions. Set `feels` to 1 to use ts_body_get_load later. */
TS_API ts_result ts_body_attach(ts_world world, ts_body body, const int32_t* vertices, size_t count, int32_t frame,
                                int32_t feels);
/* Detach vertices from their frames. The vertices keep their velocity. A count of 0 means all attached vertices. */
TS_API ts_result ts_body_detach(ts_world world, ts_body body, const int32_t* vertices, size_t count);
/* Set the mean force of a step above which each attachment of the body to a frame breaks [N, in Unreal kg cm/s^2]; 0 for
 * never. An attachment that breaks is detached after that step. The body must be attached with `feels` 1. */
TS_API ts_result ts_body_set_break_force(ts_world world, ts_body body, int32_t frame, double force);
/* Mean force of the body on a frame in the last step [N, in Unreal kg cm/s^2], and mean torque about the frame's
 * origin. The body must be attached to the frame. Both pointers can be null. */
TS_API ts_result ts_body_get_load(ts_world world, ts_body body, int32_t frame, double force[3], double torque[3]);

typedef struct ts_pull {
  uint32_t struct_size;
  int32_t triangle;  /* triangle of the body's surface, as in ts_hit */
  double weights[3]; /* weights of the triangle's vertices; 0 or more, with sum 1 */
  double point[3];   /* initial target */
  double frequency;  /* frequency of the spring [Hz]; 5 feels like a hand */
  double max_force;  /* largest force [N, in Unreal kg cm/s^2]; below 0: ten times the body's weight on Earth */
} ts_pull;

/* Grab a body's surface. A world has at most 16 grabs. */
TS_API ts_result ts_body_grab(ts_world world, ts_body body, const ts_pull* pull, ts_grab* grab);
/* Grab with an index, 0 to 15; the handle is 0 if there is none. The exported world can also contain grabs. */
TS_API ts_result ts_world_get_grab(ts_world world, int32_t number, ts_grab* grab);
TS_API ts_result ts_grab_move(ts_world world, ts_grab grab, const double point[3]);
TS_API ts_result ts_grab_release(ts_world world, ts_grab grab);
/* Force of the grab in the last substep [N, in Unreal kg cm/s^2]. */
TS_API ts_result ts_grab_get_force(ts_world world, ts_grab grab, double force[3]);

/* ---- joints and motors, in worlds with contact; removed together with their body ---- */

/* Attach vertices of a body to the body `other`. If `onto` is null, the vertices are attached at their current
 * positions in `other`; otherwise `onto` lists a vertex of `other` for each. A world has at most 64 joints with 2,048
 * vertices in total. */
TS_API ts_result ts_body_join(ts_world world, ts_body body, const int32_t* vertices, size_t count, ts_body other,
                              const int32_t* onto, ts_joint* joint);
/* Motion of a rigid body that is connected to another body: it turns about a point, or about an axis; it moves along an
 * axis; or it does not move. */
enum { TS_JOINT_BALL = 0, TS_JOINT_HINGE = 1, TS_JOINT_SLIDER = 2, TS_JOINT_FIXED = 3 };
/* Connect a rigid body to the body `other` at the point `anchor`, where the two are now. `other` must be rigid for
 * TS_JOINT_SLIDER. The axis can have any length; ball and fixed joints do not use it. */
TS_API ts_result ts_body_connect(ts_world world, ts_body body, ts_body other, int32_t kind, const double anchor[3],
                                 const double axis[3], ts_joint* joint);
/* Joint with an index, 0 to 63; the handle is 0 if there is none. The exported world can also contain joints. */
TS_API ts_result ts_world_get_joint(ts_world world, int32_t number, ts_joint* joint);
TS_API ts_result ts_joint_release(ts_world world, ts_joint joint);
/* Set the mean force of a step above which the joint breaks [N, in Unreal kg cm/s^2]; 0 for never. A joint that breaks is
 * released after that step. */
TS_API ts_result ts_joint_set_break_force(ts_world world, ts_joint joint, double force);
/* Mean force of `other` on `body` in the last step [N, in Unreal kg cm/s^2]; see ts_body_join. */
TS_API ts_result ts_joint_get_force(ts_world world, ts_joint joint, double force[3]);

typedef struct ts_drive {
  uint32_t struct_size;
  int32_t turns;     /* 1: the motor rotates vertices about the axis; 0: it pushes vertices along the axis */
  int32_t is_fixed;  /* 1: the axis is fixed in space; 0: the axis rotates with the vertices */
  int32_t has_point; /* 1: the axis passes through `point`; 0: through the centre of the vertices */
  double axis[3];    /* direction of the axis, with any nonzero length */
  double point[3];   /* used only if `turns` and `is_fixed` are 1 */
  double speed;      /* target speed [rad/s, or the unit of length/s] */
  double limit;      /* largest torque [N m, in Unreal kg cm^2/s^2] or force [N, in Unreal kg cm/s^2] */
} ts_drive;

/* A world has at most 64 motors with 16,384 vertices in total. */
TS_API ts_result ts_body_add_motor(ts_world world, ts_body body, const int32_t* vertices, size_t count,
                                   const ts_drive* drive, ts_motor* motor);
/* Motor with an index, 0 to 63; the handle is 0 if there is none. The exported world can also contain motors. */
TS_API ts_result ts_world_get_motor(ts_world world, int32_t number, ts_motor* motor);
TS_API ts_result ts_motor_set_speed(ts_world world, ts_motor motor, double speed);
/* Set the largest torque or force. With 0 the vertices coast. */
TS_API ts_result ts_motor_set_limit(ts_world world, ts_motor motor, double limit);
TS_API ts_result ts_motor_remove(ts_world world, ts_motor motor);
/* Speed of the driven vertices after the last step. */
TS_API ts_result ts_motor_get_speed(ts_world world, ts_motor motor, double* speed);
/* Mean torque or force of the motor in the last step. */
TS_API ts_result ts_motor_get_effort(ts_world world, ts_motor motor, double* effort);

/* ---- queries ---- */

typedef struct ts_pose {
  double position[3];
  double rotation[4];
} ts_pose;

typedef struct ts_hit {
  uint32_t struct_size;
  int32_t triangle; /* triangle of the body's surface, not of a mesh; -1 for a body without triangles */
  ts_body body;     /* 0 if nothing was hit; the other fields are then unchanged */
  double distance;
  double weights[3];          /* weights of the three vertices, with sum 1 */
  double point[3], normal[3]; /* the normal has unit length and points outward */
  int32_t vertices[3];
  int32_t is_inside; /* only for ts_world_closest: 1 if the given point is inside the body */
} ts_hit;

/* First surface that a ray hits from outside. `reach` is the largest distance and can be infinite. */
TS_API ts_result ts_world_raycast(ts_world world, const double origin[3], const double direction[3], double reach,
                                  ts_hit* hit);
/* Point of all surfaces that is closest to `point`. `reach` is the largest distance and can be infinite. */
TS_API ts_result ts_world_closest(ts_world world, const double point[3], double reach, ts_hit* hit);

enum { TS_BODIES = 1, TS_COLLIDERS = 2 }; /* targets of a query, as bits */
enum { TS_RAY = 0 };                      /* shape of a ray; other shapes are TS_SPHERE, TS_BOX and TS_CAPSULE */

typedef struct ts_cast {
  uint32_t struct_size;
  int32_t shape;         /* TS_RAY, TS_SPHERE, TS_BOX or TS_CAPSULE */
  double size[3];        /* as in ts_shape; unused for a ray */
  ts_pose pose;          /* pose of the shape at the start; a ray starts at its position */
  double direction[3];   /* of any nonzero length */
  double reach;          /* largest distance, can be infinite */
  int32_t targets, mask; /* what is tested: TS_BODIES + TS_COLLIDERS; bits of the groups, -1 for all */
} ts_cast;

typedef struct ts_touch {
  uint32_t struct_size;
  int32_t collider;    /* -1 for a body, or if nothing is found */
  ts_body body;        /* 0 for a collider. If nothing is found, the fields below are unchanged */
  int32_t triangle;    /* as in ts_hit; -1 for a collider */
  int32_t vertices[3]; /* for a collider unchanged, as are the weights */
  int32_t is_inside;   /* only for ts_world_nearest: 1 if the given point is inside */
  int32_t reserved;
  double weights[3];
  double distance;            /* 0 for a shape that overlaps at the start */
  double depth;               /* depth of that overlap along the normal, otherwise 0 */
  double point[3], normal[3]; /* the normal has unit length and points away from the body or collider */
} ts_touch;

/* First surface that a ray hits from outside, or that a shape touches when it moves without rotation. A shape that
 * overlaps a surface at the start touches it if the motion leads deeper. */
TS_API ts_result ts_world_cast(ts_world world, const ts_cast* cast, ts_touch* touch);
/* Point of the surfaces of bodies and colliders that is closest to `point`; `targets` and `mask` as in ts_cast. */
TS_API ts_result ts_world_nearest(ts_world world, const double point[3], double reach, int32_t targets, int32_t mask,
                                  ts_touch* touch);

/* Bodies that touch or enclose a sphere, in the order of slots. Space for as many bodies as slots is always enough. */
TS_API ts_result ts_world_overlap_sphere(ts_world world, const double center[3], double radius, ts_body* bodies,
                                         size_t capacity, size_t* count);
/* Bodies that touch or enclose a box with edges of `size`, see ts_world_overlap_sphere. */
TS_API ts_result ts_world_overlap_box(ts_world world, const ts_pose* pose, const double size[3], ts_body* bodies,
                                      size_t capacity, size_t* count);

/* ---- colliders and frames, by their numbers in the scene ---- */

enum { TS_PLANE = 0, TS_SPHERE = 1, TS_BOX = 2, TS_CAPSULE = 3 }; /* kinds of shapes */

typedef struct ts_shape {
  uint32_t struct_size;
  int32_t kind;
  double size[3];      /* box: edges; sphere: radius; capsule: radius, and length between the centres along the up axis;
                          plane: unused. The solid of a plane is below the plane */
  double friction;     /* Coulomb coefficient, usually 0.5 */
  double restitution;  /* 0 to 1; below 0, the restitution of the bodies is used */
  double thickness;    /* distance outside the shape at which contact begins */
  int32_t group, mask; /* bits, usually 1 and -1. A body and a collider collide if the mask of each contains a bit of
                          the other's group */
} ts_shape;

/* Add a collider with the lowest free number. The world must have space for it, see `World(collider_room=...)`. */
TS_API ts_result ts_collider_add(ts_world world, const ts_shape* shape, const ts_pose* pose, int32_t* collider);
/* Add a sensor: a collider that bodies do not touch. It reports bodies by TS_ENTERED and TS_LEFT, which are found after
 * each step. Sensors share numbers and space with colliders; ts_collider_move_to, ts_collider_set_velocity,
 * ts_collider_teleport and ts_collider_remove apply to them. Friction, restitution and thickness are ignored. */
TS_API ts_result ts_sensor_add(ts_world world, const ts_shape* shape, const ts_pose* pose, int32_t* sensor);
/* Bodies that touch or enclose a sensor now, see ts_world_overlap_sphere. */
TS_API ts_result ts_sensor_get_bodies(ts_world world, int32_t sensor, ts_body* bodies, size_t capacity, size_t* count);
/* Remove a collider. A later collider can reuse its number. */
TS_API ts_result ts_collider_remove(ts_world world, int32_t collider);
/* Move the collider to a pose over the next step. The collider pushes bodies in its path. */
TS_API ts_result ts_collider_move_to(ts_world world, int32_t collider, const ts_pose* pose);
TS_API ts_result ts_collider_set_velocity(ts_world world, int32_t collider, const double linear[3],
                                          const double spin[3]);
/* Set group and mask of a collider or a sensor from the next step on. Sleeping bodies near a collider wake. */
TS_API ts_result ts_collider_set_filter(ts_world world, int32_t collider, int32_t group, int32_t mask);
/* Move the surface of a collider like a conveyor belt; the collider stays where it is. `velocity` is relative to the
 * collider, in the axes of the collider. Only its part along the surface counts. Zero stops the surface. */
TS_API ts_result ts_collider_set_surface_velocity(ts_world world, int32_t collider, const double velocity[3]);
TS_API ts_result ts_collider_teleport(ts_world world, int32_t collider, const ts_pose* pose);
/* Set the Coulomb coefficient from the next step on. Sleeping bodies near the collider wake. */
TS_API ts_result ts_collider_set_friction(ts_world world, int32_t collider, double friction);
TS_API ts_result ts_collider_get_pose(ts_world world, int32_t collider, ts_pose* pose);
/* Impulse of all bodies on the collider in the last step, and angular impulse about the collider's position. Both
 * pointers can be null. */
TS_API ts_result ts_collider_get_impulse(ts_world world, int32_t collider, double impulse[3], double moment[3]);
/* Add a frame with the lowest free number. A frame is a pose that the game moves: a bone, a vehicle, a hand. */
TS_API ts_result ts_frame_add(ts_world world, const ts_pose* pose, int32_t* frame);
/* Remove a frame and detach its vertices. A later frame can reuse its number. */
TS_API ts_result ts_frame_remove(ts_world world, int32_t frame);
/* Move the frame and its attached vertices to a pose over the next step. */
TS_API ts_result ts_frame_move_to(ts_world world, int32_t frame, const ts_pose* pose);
TS_API ts_result ts_frame_get_pose(ts_world world, int32_t frame, ts_pose* pose);

#ifdef __cplusplus
}
#endif
#endif
