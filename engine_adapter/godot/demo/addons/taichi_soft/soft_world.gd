# Loads a world that `taichi-soft export --axes y-up` wrote, and steps it together with Godot's physics.
#
# Each CollisionShape3D of a physics body below this node or in the group "soft_colliders" becomes a collider for the
# soft bodies. Spheres, boxes, capsules and planes (WorldBoundaryShape3D) are supported. The colliders of moving physics
# bodies follow them in each physics frame, and soft bodies push rigid bodies. By default, a world file has space for 15
# such colliders, see World(collider_room=...).
class_name SoftWorld
extends Node3D

signal started
## `collider` is the number of the collider. `node` is its physics body, or null.
signal contact_began(which: int, collider: int, node: Node, impulse: Vector3)
signal contact_ended(which: int, collider: int, node: Node, impulse: Vector3, duration: float)
signal soft_contact_began(which: int, other: int, impulse: Vector3)
signal soft_contact_ended(which: int, other: int, impulse: Vector3, duration: float)
signal body_slept(which: int)
signal body_woke(which: int)
signal body_froze(which: int)

enum Kind { BODY, ASSET, COLLIDER, FRAME, MESH, JOINT, MOTOR }
enum Status { ACTIVE, FROZEN, ASLEEP }
enum Shape { PLANE, SPHERE, BOX, CAPSULE }
enum Event { CONTACT_BEGAN = 1, CONTACT_ENDED = 2, SLEPT = 4, WOKE = 8, FROZE = 16 }

const NATIVE := "SoftWorldNative"  # the class of taichi_soft.gdextension
# Godot 3: const NATIVE := preload("res://addons/taichi_soft/soft_world_native.gdns")
const AFTER_OTHERS := 100  # priority of a node that runs after the nodes that move physics bodies
const NEARLY := 1.0 - 1e-6
const VALUES_PER_EVENT := 8
const TOLD_BY := {
    "contact_began": Event.CONTACT_BEGAN,
    "contact_ended": Event.CONTACT_ENDED,
    "soft_contact_began": Event.CONTACT_BEGAN,
    "soft_contact_ended": Event.CONTACT_ENDED,
    "body_slept": Event.SLEPT,
    "body_woke": Event.WOKE,
    "body_froze": Event.FROZE,
}

@export_dir var world_file := ""
@export var autostart := true
## Number of substeps of a step. With 0, the library chooses a stable number.
@export_range(0, 1000) var substeps := 0
@export_group("Colliders of Godot's shapes")
@export_range(0.0, 2.0, 0.01) var friction := 0.5
## Restitution of the colliders. Below 0, the restitution of the soft bodies is used.
@export_range(-1.0, 1.0, 0.01) var restitution := -1.0
@export_range(0.0, 1.0, 0.001) var thickness := 0.0

var native: RefCounted = null  # SoftWorldNative; null before `start`

var _dt := 0.0
var _shapes := {}  # transform from the library's shape to Godot's shape, by number of the collider
var _followed: Array[Dictionary] = []
var _nodes := {}  # WeakRef of the physics body, by number of the collider
var _nodes_gone := {}  # the entries of `_nodes` for colliders that were removed since the last step
var _recorded := 0  # bits of Event


func _ready() -> void:
    process_physics_priority = AFTER_OTHERS
    set_physics_process(false)
    if autostart and world_file != "":
        start()


func _physics_process(delta: float) -> void:
    step(delta)


## Load the world file, which takes seconds. Return true on success.
func start() -> bool:
    stop()
    var fresh: RefCounted = ClassDB.instantiate(NATIVE) if ClassDB.class_exists(NATIVE) else null
    # Godot 3: var fresh: Reference = NATIVE.new()
    if fresh == null:
        push_error("there is no class SoftWorldNative: Godot has not loaded the library of addons/taichi_soft")
        return false
    if fresh.load(ProjectSettings.globalize_path(world_file)) == null:
        return false
    native = fresh
    for node in _physics_bodies():
        _follow(node)
    set_physics_process(true)
    started.emit()
    return true


## Unload the world and all its bodies.
func stop() -> void:
    set_physics_process(false)
    native = null
    _dt = 0.0
    _shapes.clear()
    _followed.clear()
    _nodes.clear()
    _nodes_gone.clear()
    _recorded = 0


## Make one step of `delta` seconds. The node calls this in each physics frame. Return false if the step failed.
func step(delta: float) -> bool:
    if not _is_started("step") or not _set_step(delta):
        return false
    for each in _followed.duplicate():
        _move(each)
    _record()
    # Godot has already made its own step. Its rigid bodies receive the impulses of this soft step in their next step.
    if native.advance(delta) == null:
        return false
    for each in _followed:
        _push_back(each)
    _tell()
    return true


## Return the body with a name from the world's script; 0 if there is none.
func body(body_name: String) -> int:
    if not _is_started("body"):
        return 0
    var slot = native.find(Kind.BODY, body_name)
    return 0 if slot == null else native.body(slot)


## Add a body of an asset and return it; 0 if the library refuses the call.
func spawn(asset_name: String, place: Transform3D, velocity := Vector3(), spin := Vector3()) -> int:
    if not _is_started("spawn"):
        return 0
    var asset = native.find(Kind.ASSET, asset_name)
    if asset == null:
        return 0
    var made = native.spawn(asset, place, velocity, spin)
    return 0 if made == null else made


func despawn(which: int) -> bool:
    return _is_started("despawn") and native.despawn(which) != null


## Move a collider to a place over the next step. `which` is a name from the world's script or a number from
## add_collider.
func move_collider(which: Variant, place: Transform3D) -> bool:
    var number := _number(Kind.COLLIDER, which, "move_collider")
    if number < 0:
        return false
    var turn: Transform3D = _shapes.get(number, Transform3D())
    return native.move_collider(number, place * turn) != null


## Add a collider with one of Godot's shapes. Return its number, or -1 if the call is refused.
func add_collider(shape: Resource, place: Transform3D) -> int:
    if not _is_started("add_collider"):
        return -1
    var kind: int = Shape.SPHERE
    var size := Vector3()
    var turn := Transform3D()
    if shape is SphereShape3D:
        size.x = shape.radius
    elif shape is BoxShape3D:
        kind = Shape.BOX
        size = shape.size
        # Godot 3: size = 2.0 * shape.extents
    elif shape is CapsuleShape3D:
        kind = Shape.CAPSULE
        size = Vector3(shape.radius, maxf(shape.height - 2.0 * shape.radius, 0.0), 0.0)  # without the caps
        # Godot 3: size = Vector3(shape.radius, shape.height, 0.0)
        # Godot 3: turn.basis = Basis(Vector3.RIGHT, PI / 2)  # Godot's lies along z, the library's along y
    elif shape is WorldBoundaryShape3D:
        kind = Shape.PLANE
        turn = _above(shape.plane)
    else:
        push_error("%s is no SphereShape3D, BoxShape3D, CapsuleShape3D or WorldBoundaryShape3D" % shape)
        return -1
    if not place.basis.get_scale().is_equal_approx(Vector3.ONE):
        push_error("a collider has the scale %s: change the shape's own size instead" % place.basis.get_scale())
        return -1
    var made = native.add_collider(kind, size, place * turn, friction, restitution, thickness, 1, -1)
    if made == null:
        return -1
    _shapes[made] = turn
    return made


func remove_collider(number: int) -> bool:
    if not _is_started("remove_collider") or native.remove_collider(number) == null:
        return false
    _shapes.erase(number)
    if number in _nodes and not number in _nodes_gone:
        _nodes_gone[number] = _nodes[number]
    _nodes.erase(number)
    return true


## Return the impulse of all bodies on a collider in the last step [N s].
func collider_impulse(which: Variant) -> Vector3:
    var number := _number(Kind.COLLIDER, which, "collider_impulse")
    var found = null if number < 0 else native.collider_impulse(number)
    return Vector3() if found == null else found[0]


## Find the first soft body that a ray hits. Return body, point, normal, distance, and the hit triangle of the body's
## surface with the weights and the numbers of its vertices. The Dictionary is empty if the ray hits no body.
func raycast(origin: Vector3, direction: Vector3, reach := INF) -> Dictionary:
    var found = native.raycast(origin, direction, reach) if _is_started("raycast") else null
    if found == null or found.is_empty():
        return {}
    return {
        "body": found[0],
        "triangle": found[1],
        "distance": found[2],
        "point": found[3],
        "normal": found[4],
        "weights": found[5],
        "vertices": found[6],
    }


## Return the bodies that touch or enclose a sphere.
func overlap_sphere(center: Vector3, radius: float) -> Array:
    var found = native.overlap_sphere(center, radius) if _is_started("overlap_sphere") else null
    return [] if found == null else found


## Return the bodies that touch or enclose a box with edges of `size`.
func overlap_box(place: Transform3D, size: Vector3) -> Array:
    var found = native.overlap_box(place, size) if _is_started("overlap_box") else null
    return [] if found == null else found


## Grab a body at a result of `raycast`. The initial target is the point of the hit. Return the grab, or 0 if `hit` is
## empty.
func grab(hit: Dictionary, frequency := 5.0, max_force := -1.0) -> int:
    if not _is_started("grab") or hit.is_empty():
        return 0
    var made = native.grab(hit.body, hit.triangle, hit.weights, hit.point, frequency, max_force)
    return 0 if made == null else made


## Move the target of a grab.
func move_grab(which: int, point: Vector3) -> bool:
    return _is_started("move_grab") and native.move_grab(which, point) != null


func release_grab(which: int) -> bool:
    return _is_started("release_grab") and native.release_grab(which) != null


## Return the force of a grab [N].
func grab_force(which: int) -> Vector3:
    var found = native.grab_force(which) if _is_started("grab_force") else null
    return Vector3() if found == null else found


## Set gravity [m/s^2] from the next step on.
func set_gravity(gravity: Vector3) -> bool:
    return _is_started("set_gravity") and native.set_gravity(gravity) != null


## Set the Coulomb coefficient of a body for contact with other bodies. For colliders, see set_collider_friction.
func set_body_friction(which: int, friction: float) -> bool:
    return _is_started("set_body_friction") and native.set_body_friction(which, friction) != null


func set_collider_friction(collider: Variant, friction: float) -> bool:
    var number := _number(Kind.COLLIDER, collider, "set_collider_friction")
    return number >= 0 and native.set_collider_friction(number, friction) != null


## Attach vertices to the body `other`: at their current positions in it, or each to one of its vertices in `onto`.
## Return the joint, or 0 if the call is refused.
func join(which: int, vertices: PackedInt32Array, other: int, onto := PackedInt32Array()) -> int:
    var made = native.join(which, vertices, other, onto) if _is_started("join") else null
    return 0 if made == null else made


## Return the joint with a name from the world's script; 0 if there is none.
func joint(called: Variant) -> int:
    var number := _number(Kind.JOINT, called, "joint")
    var found = null if number < 0 else native.joint_of(number)
    return 0 if found == null else found


func release_joint(which: int) -> bool:
    return _is_started("release_joint") and native.release_joint(which) != null


## Return the force of the other body on the joint's vertices [N].
func joint_force(which: int) -> Vector3:
    var found = native.joint_force(which) if _is_started("joint_force") else null
    return Vector3() if found == null else found


## Add a motor that rotates vertices about an axis with at most `max_torque` [N m]. The axis rotates with the vertices.
## Return the motor, or 0 if the call is refused.
func add_motor(which: int, vertices: PackedInt32Array, axis: Vector3, speed: float, max_torque: float) -> int:
    if not _is_started("add_motor"):
        return 0
    var made = native.add_motor(which, vertices, 1, 0, 0, axis, Vector3(), speed, max_torque)
    return 0 if made == null else made


## Return the motor with a name from the world's script; 0 if there is none.
func motor(called: Variant) -> int:
    var number := _number(Kind.MOTOR, called, "motor")
    var found = null if number < 0 else native.motor_of(number)
    return 0 if found == null else found


func set_motor_speed(which: int, speed: float) -> bool:
    return _is_started("set_motor_speed") and native.set_motor_speed(which, speed) != null


## Set the largest torque [N m] or force [N] of a motor. With 0 the vertices coast.
func set_motor_limit(which: int, limit: float) -> bool:
    return _is_started("set_motor_limit") and native.set_motor_limit(which, limit) != null


func remove_motor(which: int) -> bool:
    return _is_started("remove_motor") and native.remove_motor(which) != null


## Change the level of detail of a body; 0 is the finest. Each level has its own vertices. If joints, motors or
## attachments prevent the change, they are released if `release` is true; otherwise return false.
func set_level(which: int, level: int, release := false) -> bool:
    return _is_started("set_level") and native.set_level(which, level, int(release)) != null


## Return the level of detail of a body; -1 if the body does not exist.
func get_level(which: int) -> int:
    var found = native.get_level(which) if _is_started("get_level") else null
    return -1 if found == null else found


## Return the number of levels of detail of a body; 0 if the body does not exist.
func level_count(which: int) -> int:
    var asset = native.asset_of(which) if _is_started("level_count") else null
    return 0 if asset == null else native.level_count(asset)


## Return the positions of all vertices of a body at its current level of detail.
func positions(which: int) -> PackedVector3Array:
    var found = native.positions(which) if _is_started("positions") else null
    return PackedVector3Array() if found == null else found


## Add a frame, a pose that the game moves and that vertices can be attached to. Return its number, or -1 if the call is
## refused.
func add_frame(place: Transform3D) -> int:
    var made = native.add_frame(place) if _is_started("add_frame") else null
    return -1 if made == null else made


## Move a frame to a place over the next step. `frame` is a name from the world's script or a number from add_frame.
func move_frame(frame: Variant, place: Transform3D) -> bool:
    var number := _number(Kind.FRAME, frame, "move_frame")
    return number >= 0 and native.move_frame(number, place) != null


## Remove a frame and detach its vertices.
func remove_frame(frame: Variant) -> bool:
    var number := _number(Kind.FRAME, frame, "remove_frame")
    return number >= 0 and native.remove_frame(number) != null


## Attach vertices to a frame at their current positions. Set `feels` to true to use frame_load later.
func attach(which: int, vertices: PackedInt32Array, frame: Variant, feels := false) -> bool:
    var number := _number(Kind.FRAME, frame, "attach")
    return number >= 0 and native.attach(which, vertices, number, int(feels)) != null


## Detach vertices from frames. Without a list of vertices, detach all attached vertices of the body.
func detach(which: int, vertices := PackedInt32Array()) -> bool:
    return _is_started("detach") and native.detach(which, vertices) != null


## Return the mean force of a body on a frame in the last step [N].
func frame_load(which: int, frame: Variant) -> Vector3:
    var number := _number(Kind.FRAME, frame, "frame_load")
    var found = null if number < 0 else native.frame_load(which, number)
    return Vector3() if found == null else found[0]


## Return a hash of the state. A world of Python in the same state has the same hash.
func state_hash() -> String:
    return native.state_hash() if _is_started("state_hash") else ""


## Return the state of the soft bodies and their colliders. The snapshot does not contain Godot's physics bodies.
func snapshot() -> PackedByteArray:
    return native.snapshot() if _is_started("snapshot") else PackedByteArray()


func restore(bytes: PackedByteArray) -> bool:
    return _is_started("restore") and native.restore(bytes) != null


func last_error() -> String:
    return "" if native == null else native.last_error()


func _is_started(what: String) -> bool:
    if native == null:
        push_error("%s: the soft world %s has not started" % [what, name])
    return native != null


func _number(kind: Kind, which: Variant, what: String) -> int:
    if not _is_started(what):
        return -1
    var number = which
    if which is String or which is StringName:
    # Godot 3: if which is String:
        number = native.find(kind, which)
    if typeof(number) != TYPE_INT or number < 0:
        if number != null:
            push_error("%s: %s is neither a name nor a number" % [what, which])
        return -1
    return number


func _set_step(delta: float) -> bool:
    if delta == _dt:
        return true
    if native.set_fixed_step(delta, substeps, 1) == null:
        return false
    _dt = delta
    # Drawn positions are interpolated between the states before (alpha 0) and after (alpha 1) the last step. Adding
    # nearly a step of time here keeps alpha close to 1, so that soft bodies are drawn in step with Godot's own bodies.
    return native.advance(NEARLY * delta) != null


# Return a transform whose y axis is the normal of a plane and whose origin is on the plane.
func _above(plane: Plane) -> Transform3D:
    var up := plane.normal.normalized()
    var aside := Vector3.RIGHT if absf(up.x) < 0.9 else Vector3.BACK
    var right := up.cross(aside).normalized()
    return Transform3D(Basis(right, up, right.cross(up)), plane.d / plane.normal.length() * up)


func _physics_bodies() -> Array[PhysicsBody3D]:
    var found: Array[PhysicsBody3D] = []
    var waiting: Array[Node] = [self]
    while not waiting.is_empty():
        var node: Node = waiting.pop_back()
        if node is PhysicsBody3D:
            found.append(node)
        var children := node.get_children()
        children.reverse()  # so that bodies are found in the order of the scene
        for child in children:
            waiting.append(child)
    for node in get_tree().get_nodes_in_group("soft_colliders"):
        if node is PhysicsBody3D and not node in found:
            found.append(node)
    return found


func _follow(physics_body: PhysicsBody3D) -> void:
    # The class of moving bodies can be a subclass of the class of static bodies.
    var stays := physics_body is StaticBody3D and not physics_body is AnimatableBody3D
    for shape in physics_body.get_children():
        if not shape is CollisionShape3D or shape.disabled or shape.shape == null:
            continue
        var number := add_collider(shape.shape, shape.global_transform)
        if number < 0:
            continue
        _nodes[number] = weakref(physics_body)
        if not stays:
            _followed.append(
                {
                    "body": weakref(physics_body),
                    "shape": weakref(shape),
                    "number": number,
                    "place": shape.global_transform,
                    "last": [Vector3(), Vector3()],
                }
            )


# Record only events with connected signals, because finding contacts takes time.
func _record() -> void:
    var kinds := 0
    for told_by in TOLD_BY:
        if get_signal_connection_list(told_by).size() > 0:
            kinds |= TOLD_BY[told_by]
    if kinds != _recorded:
        _recorded = kinds
        native.record_events(kinds)


func _tell() -> void:
    var gone := _nodes_gone
    _nodes_gone = {}
    if _recorded == 0:
        return
    var events: Array = native.drain_events()
    for i in range(0, events.size(), VALUES_PER_EVENT):
        var who: int = events[i + 1]
        var other: int = events[i + 2]
        var collider: int = events[i + 3]
        var impulse: Vector3 = events[i + 4]
        var duration: float = events[i + 5]
        match events[i]:
            Event.CONTACT_BEGAN:
                if collider < 0:
                    soft_contact_began.emit(who, other, impulse)
                else:
                    var node := _node(_nodes.get(collider))
                    contact_began.emit(who, collider, node, impulse)
            Event.CONTACT_ENDED:
                if collider < 0:
                    soft_contact_ended.emit(who, other, impulse, duration)
                else:
                    var node := _node(gone.get(collider, _nodes.get(collider)))
                    contact_ended.emit(who, collider, node, impulse, duration)
            Event.SLEPT:
                body_slept.emit(who)
            Event.WOKE:
                body_woke.emit(who)
            Event.FROZE:
                body_froze.emit(who)


func _node(reference: WeakRef) -> Node:
    return null if reference == null else reference.get_ref()


func _move(each: Dictionary) -> void:
    var shape: CollisionShape3D = each.shape.get_ref()
    if shape == null or not shape.is_inside_tree():
        remove_collider(each.number)
        _followed.erase(each)
        return
    var place := shape.global_transform
    var rigid := each.body.get_ref() as RigidBody3D
    if rigid != null:
        # Read the pose from the physics server. With Bullet, the pose of the node is one step late, which would add
        # energy to the coupled bodies.
        var state := PhysicsServer3D.body_get_direct_state(rigid.get_rid())
        if state != null:
            place = state.transform * shape.transform
    if place != each.place:
        each.place = place
        move_collider(each.number, place)


# Rigid bodies receive impulses one step late. To predict the next impulse, half of the present one is added now and
# subtracted in the next step, see docs/coupling.md.
func _push_back(each: Dictionary) -> void:
    var rigid := each.body.get_ref() as RigidBody3D
    if rigid == null or rigid.freeze:
    # Godot 3: if rigid == null or rigid.mode != RigidBody.MODE_RIGID and rigid.mode != RigidBody.MODE_CHARACTER:
        return
    var now: Array = native.collider_impulse(each.number)
    var impulse: Vector3 = 1.5 * now[0] - 0.5 * each.last[0]
    var moment: Vector3 = 1.5 * now[1] - 0.5 * each.last[1]
    each.last = now
    if impulse != Vector3() or moment != Vector3():
        var state := PhysicsServer3D.body_get_direct_state(rigid.get_rid())
        var middle := rigid.global_transform.origin if state == null else state.transform.origin
        rigid.apply_impulse(impulse, native.collider_position(each.number) - middle)
        # Godot 3: rigid.apply_impulse(native.collider_position(each.number) - middle, impulse)
        rigid.apply_torque_impulse(moment)
