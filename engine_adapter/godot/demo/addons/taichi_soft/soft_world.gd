# Steps a world from `taichi-soft export --axes y-up` together with Godot's physics.
#
# Physics bodies below this node, or in the group "soft_colliders", are colliders of the soft bodies, by their
# CollisionShapes: spheres, boxes, capsules and planes. Colliders follow kinematic and rigid bodies in each
# physics frame, and rigid bodies are pushed. The world file needs capacity for them: World(collider_room=...).
class_name SoftWorld
extends Spatial

signal started()
# `collider` is a number; `node` is the physics body of the collider, or null.
signal contact_began(body, collider, node, impulse)
signal contact_ended(body, collider, node, impulse, duration)
signal soft_contact_began(body, other, impulse)
signal soft_contact_ended(body, other, impulse, duration)
signal body_slept(body)
signal body_woke(body)
signal body_froze(body)

enum Kind { BODY, ASSET, COLLIDER, FRAME, MESH, JOINT, MOTOR }
enum Status { ACTIVE, FROZEN, ASLEEP }
enum Shape { PLANE, SPHERE, BOX, CAPSULE }
enum Event { CONTACT_BEGAN = 1, CONTACT_ENDED = 2, SLEPT = 4, WOKE = 8, FROZE = 16 }

const Native := preload("res://addons/taichi_soft/soft_world_native.gdns")
const AFTER_OTHERS := 100  # runs after scripts that move kinematic bodies
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

export(String, DIR) var world_file := ""
export var autostart := true
# Substeps of a step; 0 chooses a stable number.
export(int, 0, 1000) var substeps := 0
# Friction of colliders that this node makes from Godot's shapes.
export(float, 0, 2) var friction := 0.5
# Restitution of these colliders; below 0 uses that of the bodies.
export(float, -1, 1) var restitution := -1.0
export(float, 0, 1) var thickness := 0.0

var native: Reference  # the functions of SoftWorldNative; null until started

var _dt := 0.0
var _shapes := {}  # by collider: transform from the shape's axes to those of its resource
var _followed := []
var _nodes := {}  # by collider: WeakRef of its physics body
var _nodes_gone := {}  # the same for colliders removed since the last step
var _recorded := 0  # bits of Event


func _ready() -> void:
    process_priority = AFTER_OTHERS
    set_physics_process(false)
    if autostart and world_file != "":
        start()


func _physics_process(delta: float) -> void:
    step(delta)


# Load the world file. Returns false if that failed.
func start() -> bool:
    stop()
    var fresh: Reference = Native.new()
    if fresh.load(ProjectSettings.globalize_path(world_file)) == null:
        return false
    native = fresh
    for body in _physics_bodies():
        _follow(body)
    set_physics_process(true)
    emit_signal("started")
    return true


# Destroy the world and its bodies.
func stop() -> void:
    set_physics_process(false)
    native = null
    _dt = 0.0
    _shapes.clear()
    _followed.clear()
    _nodes.clear()
    _nodes_gone.clear()
    _recorded = 0


# Make one step of `delta` seconds; called in each physics frame.
func step(delta: float) -> bool:
    if not _is_started("step") or not _set_step(delta):
        return false
    for each in _followed.duplicate():
        _move(each)
    _record()
    # Godot has made its step. It receives the impulses of this step in its next one.
    if native.advance(delta) == null:
        return false
    for each in _followed:
        _push_back(each)
    _tell()
    return true


# Return the body with a name of the world's script; 0 for none.
func body(body_name: String) -> int:
    if not _is_started("body"):
        return 0
    var slot = native.find(Kind.BODY, body_name)
    return 0 if slot == null else native.body(slot)


# Spawn a body. Returns 0 if that is refused.
func spawn(asset_name: String, place: Transform, velocity := Vector3(), spin := Vector3()) -> int:
    if not _is_started("spawn"):
        return 0
    var asset = native.find(Kind.ASSET, asset_name)
    if asset == null:
        return 0
    var made = native.spawn(asset, place, velocity, spin)
    return 0 if made == null else made


func despawn(which: int) -> bool:
    return _is_started("despawn") and native.despawn(which) != null


# Move a collider over the next step. `which` is a name of the world's script or a number from add_collider.
func move_collider(which, place: Transform) -> bool:
    var number := _number(Kind.COLLIDER, which, "move_collider")
    return number >= 0 and native.move_collider(number, place * _shapes.get(number, Transform())) != null


# Add a collider from one of Godot's shapes. Returns its number, or -1 if that is refused.
func add_collider(shape: Resource, place: Transform) -> int:
    if not _is_started("add_collider"):
        return -1
    var kind: int = Shape.SPHERE
    var size := Vector3()
    var turn := Transform()
    if shape is SphereShape:
        size.x = shape.radius
    elif shape is BoxShape:
        kind = Shape.BOX
        size = 2.0 * shape.extents
    elif shape is CapsuleShape:
        kind = Shape.CAPSULE
        size = Vector3(shape.radius, shape.height, 0.0)
        turn.basis = Basis(Vector3.RIGHT, PI / 2)  # Godot's capsule is along z, the library's along y
    elif shape is PlaneShape:
        kind = Shape.PLANE
        turn = _above(shape.plane)
    else:
        push_error("%s is not a SphereShape, BoxShape, CapsuleShape or PlaneShape" % shape)
        return -1
    if not place.basis.get_scale().is_equal_approx(Vector3.ONE):
        push_error("a collider has the scale %s: change the size of its shape instead" % place.basis.get_scale())
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


# Impulse of bodies on a collider in the last step [N s].
func collider_impulse(which) -> Vector3:
    var number := _number(Kind.COLLIDER, which, "collider_impulse")
    var found = null if number < 0 else native.collider_impulse(number)
    return Vector3() if found == null else found[0]


# Find the first soft body on a ray: body, point, normal, distance, and triangle, weights and vertices of its surface.
# Returns an empty Dictionary if there is none.
func raycast(origin: Vector3, direction: Vector3, reach := INF) -> Dictionary:
    var found = native.raycast(origin, direction, reach) if _is_started("raycast") else null
    if not found:
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


# Return the bodies that touch or enclose a sphere.
func overlap_sphere(center: Vector3, radius: float) -> Array:
    var found = native.overlap_sphere(center, radius) if _is_started("overlap_sphere") else null
    return [] if found == null else found


# Return the bodies that touch or enclose a box with edges of `size`.
func overlap_box(place: Transform, size: Vector3) -> Array:
    var found = native.overlap_box(place, size) if _is_started("overlap_box") else null
    return [] if found == null else found


# Grab a body at a hit of `raycast`. Returns the number of the grab; 0 if nothing was hit.
func grab(hit: Dictionary, frequency := 5.0, max_force := -1.0) -> int:
    if not _is_started("grab") or hit.empty():
        return 0
    var made = native.grab(hit.body, hit.triangle, hit.weights, hit.point, frequency, max_force)
    return 0 if made == null else made


# Move a grab to another point.
func move_grab(which: int, point: Vector3) -> bool:
    return _is_started("move_grab") and native.move_grab(which, point) != null


func release_grab(which: int) -> bool:
    return _is_started("release_grab") and native.release_grab(which) != null


# Force of a grab [N].
func grab_force(which: int) -> Vector3:
    var found = native.grab_force(which) if _is_started("grab_force") else null
    return Vector3() if found == null else found


# Gravity [m/s^2], from the next step on.
func set_gravity(gravity: Vector3) -> bool:
    return _is_started("set_gravity") and native.set_gravity(gravity) != null


# Coulomb coefficient of a body against other bodies. For a collider, by name or number, use set_collider_friction.
func set_body_friction(which: int, friction: float) -> bool:
    return _is_started("set_body_friction") and native.set_body_friction(which, friction) != null


func set_collider_friction(collider, friction: float) -> bool:
    var number := _number(Kind.COLLIDER, collider, "set_collider_friction")
    return number >= 0 and native.set_collider_friction(number, friction) != null


# Attach vertices to another body, at their current positions in it or each to one of its vertices. Returns the number
# of the joint, or 0 if that is refused.
func join(which: int, vertices: PoolIntArray, other: int, onto := PoolIntArray()) -> int:
    var made = native.join(which, vertices, other, onto) if _is_started("join") else null
    return 0 if made == null else made


# Return the joint with a name of the world's script; 0 for none.
func joint(called) -> int:
    var number := _number(Kind.JOINT, called, "joint")
    var found = null if number < 0 else native.joint_of(number)
    return 0 if found == null else found


func release_joint(which: int) -> bool:
    return _is_started("release_joint") and native.release_joint(which) != null


# Force of the other body of a joint [N].
func joint_force(which: int) -> Vector3:
    var found = native.joint_force(which) if _is_started("joint_force") else null
    return Vector3() if found == null else found


# Rotate vertices about an axis that rotates with them, with a limited torque. Returns the number of the motor, or 0 if
# that is refused.
func add_motor(which: int, vertices: PoolIntArray, axis: Vector3, speed: float, max_torque: float) -> int:
    if not _is_started("add_motor"):
        return 0
    var made = native.add_motor(which, vertices, 1, 0, 0, axis, Vector3(), speed, max_torque)
    return 0 if made == null else made


# Return the motor with a name of the world's script; 0 for none.
func motor(called) -> int:
    var number := _number(Kind.MOTOR, called, "motor")
    var found = null if number < 0 else native.motor_of(number)
    return 0 if found == null else found


func set_motor_speed(which: int, speed: float) -> bool:
    return _is_started("set_motor_speed") and native.set_motor_speed(which, speed) != null


# Limit of the torque; with 0 the vertices coast.
func set_motor_limit(which: int, limit: float) -> bool:
    return _is_started("set_motor_limit") and native.set_motor_limit(which, limit) != null


func remove_motor(which: int) -> bool:
    return _is_started("remove_motor") and native.remove_motor(which) != null


# Change the level of detail of a body: 0 is the finest. Returns false if joints, motors or attachments prevent it;
# with `release` they are released. Each level has its own vertices.
func set_level(which: int, level: int, release := false) -> bool:
    return _is_started("set_level") and native.set_level(which, level, int(release)) != null


# Return the level of detail of a body; -1 for no body.
func get_level(which: int) -> int:
    var found = native.get_level(which) if _is_started("get_level") else null
    return -1 if found == null else found


# Return the number of levels of detail of a body; 0 for no body.
func level_count(which: int) -> int:
    var asset = native.asset_of(which) if _is_started("level_count") else null
    return 0 if asset == null else native.level_count(asset)


# Return the positions of a body's vertices at its level of detail.
func positions(which: int) -> PoolVector3Array:
    var found = native.positions(which) if _is_started("positions") else null
    return PoolVector3Array() if found == null else found


# Add a frame, a pose that the game moves and bodies attach to. Returns its number, or -1 if that is refused.
func add_frame(place: Transform) -> int:
    var made = native.add_frame(place) if _is_started("add_frame") else null
    return -1 if made == null else made


# Move a frame over the next step. `frame` is a name of the world's script or a number from add_frame.
func move_frame(frame, place: Transform) -> bool:
    var number := _number(Kind.FRAME, frame, "move_frame")
    return number >= 0 and native.move_frame(number, place) != null


# Remove a frame and detach its vertices.
func remove_frame(frame) -> bool:
    var number := _number(Kind.FRAME, frame, "remove_frame")
    return number >= 0 and native.remove_frame(number) != null


# Attach vertices to a frame at their current positions. Set `feels` to use frame_load later.
func attach(which: int, vertices: PoolIntArray, frame, feels := false) -> bool:
    var number := _number(Kind.FRAME, frame, "attach")
    return number >= 0 and native.attach(which, vertices, number, int(feels)) != null


# Detach vertices from frames; an empty array detaches all.
func detach(which: int, vertices := PoolIntArray()) -> bool:
    return _is_started("detach") and native.detach(which, vertices) != null


# Force of a body on a frame in the last step [N].
func frame_load(which: int, frame) -> Vector3:
    var number := _number(Kind.FRAME, frame, "frame_load")
    var found = null if number < 0 else native.frame_load(which, number)
    return Vector3() if found == null else found[0]


# Hash of the state, equal to that of Python's world in the same state. (Object already has a function hash.)
func state_hash() -> String:
    return "" if not _is_started("state_hash") else native.state_hash()


# Snapshot of the soft bodies and their colliders, without Godot's bodies.
func snapshot() -> PoolByteArray:
    return native.snapshot() if _is_started("snapshot") else PoolByteArray()


func restore(bytes: PoolByteArray) -> bool:
    return _is_started("restore") and native.restore(bytes) != null


func last_error() -> String:
    return "" if native == null else native.last_error()


func _is_started(what: String) -> bool:
    if native == null:
        push_error("%s: the soft world %s has not started" % [what, name])
    return native != null


func _number(kind: int, which, what: String) -> int:
    if not _is_started(what):
        return -1
    var number = which
    if which is String:
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
    # Bodies are drawn at alpha between the last two steps. Adding almost a full step here keeps alpha near 1, the
    # time at which Godot draws its bodies.
    return native.advance(NEARLY * delta) != null


# Transform from a plane to axes with y along its normal.
func _above(plane: Plane) -> Transform:
    var up := plane.normal.normalized()
    var aside := Vector3.RIGHT if abs(up.x) < 0.9 else Vector3.BACK
    var right := up.cross(aside).normalized()
    return Transform(Basis(right, up, right.cross(up)), plane.d / plane.normal.length() * up)


func _physics_bodies() -> Array:
    var found := []
    var waiting := [self]
    while waiting:
        var node: Node = waiting.pop_back()
        if node is PhysicsBody:
            found.append(node)
        var children := node.get_children()
        children.invert()  # keeps the order of the scene
        waiting += children
    for node in get_tree().get_nodes_in_group("soft_colliders"):
        if node is PhysicsBody and not node in found:
            found.append(node)
    return found


func _follow(body: PhysicsBody) -> void:
    for shape in body.get_children():
        if not shape is CollisionShape or shape.disabled or shape.shape == null:
            continue
        var number := add_collider(shape.shape, shape.global_transform)
        if number < 0:
            continue
        _nodes[number] = weakref(body)
        if not body is StaticBody:
            _followed.append(
                {
                    "body": weakref(body),
                    "shape": weakref(shape),
                    "number": number,
                    "place": shape.global_transform,
                    "last": [Vector3(), Vector3()],
                }
            )


# Record only events with a connected signal, because recording contacts takes time.
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
                    emit_signal("soft_contact_began", who, other, impulse)
                else:
                    var node := _node(_nodes.get(collider))
                    emit_signal("contact_began", who, collider, node, impulse)
            Event.CONTACT_ENDED:
                if collider < 0:
                    emit_signal("soft_contact_ended", who, other, impulse, duration)
                else:
                    var node := _node(gone.get(collider, _nodes.get(collider)))
                    emit_signal("contact_ended", who, collider, node, impulse, duration)
            Event.SLEPT:
                emit_signal("body_slept", who)
            Event.WOKE:
                emit_signal("body_woke", who)
            Event.FROZE:
                emit_signal("body_froze", who)


func _node(reference: WeakRef) -> Node:
    return null if reference == null else reference.get_ref()


func _move(each: Dictionary) -> void:
    var shape: CollisionShape = each.shape.get_ref()
    if shape == null or not shape.is_inside_tree():
        remove_collider(each.number)
        _followed.erase(each)
        return
    var place := shape.global_transform
    var rigid := each.body.get_ref() as RigidBody
    if rigid != null:
        # With Bullet the node's transform is one step late, which would add energy to coupled bodies.
        var state := PhysicsServer.body_get_direct_state(rigid.get_rid())
        if state != null:
            place = state.transform * shape.transform
    if place != each.place:
        each.place = place
        move_collider(each.number, place)


# The engine receives impulses one step late. So half of each is applied in advance and subtracted later, see
# docs/coupling.md.
func _push_back(each: Dictionary) -> void:
    var rigid := each.body.get_ref() as RigidBody
    if rigid == null or rigid.mode != RigidBody.MODE_RIGID and rigid.mode != RigidBody.MODE_CHARACTER:
        return
    var now: Array = native.collider_impulse(each.number)
    var impulse: Vector3 = 1.5 * now[0] - 0.5 * each.last[0]
    var moment: Vector3 = 1.5 * now[1] - 0.5 * each.last[1]
    each.last = now
    if impulse != Vector3() or moment != Vector3():
        var state := PhysicsServer.body_get_direct_state(rigid.get_rid())
        var middle := rigid.global_transform.origin if state == null else state.transform.origin
        rigid.apply_impulse(native.collider_position(each.number) - middle, impulse)
        rigid.apply_torque_impulse(moment)
