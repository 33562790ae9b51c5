# A world that `taichi-soft export --axes y-up` wrote, stepped with Godot's own physics.
#
# Physics bodies below this node, or in the group "soft_colliders", are colliders of the soft bodies, by their
# CollisionShapes: spheres, boxes, capsules and planes. Kinematic and rigid bodies are followed in each physics
# frame, and rigid bodies are pushed. The world file needs room for them: World(collider_room=...).
class_name SoftWorld
extends Spatial

signal started()
signal body_slept(body)
signal body_woke(body)
signal body_froze(body)

enum Kind { BODY, ASSET, COLLIDER, FRAME, MESH }
enum Status { ACTIVE, FROZEN, ASLEEP }
enum Shape { PLANE, SPHERE, BOX, CAPSULE }

const Native := preload("res://addons/taichi_soft/soft_world_native.gdns")
const AFTER_OTHERS := 100  # so that what moves kinematic bodies comes first
const NEARLY := 1.0 - 1e-6

export(String, DIR) var world_file := ""
export var autostart := true
# Of a step; 0 for as many as are stable.
export(int, 0, 1000) var substeps := 0
# Of the colliders that this node makes of Godot's shapes.
export(float, 0, 2) var friction := 0.5
# Below 0 for the bodies' own.
export(float, -1, 1) var restitution := -1.0
export(float, 0, 1) var thickness := 0.0

var native: Reference  # the functions of SoftWorldNative; null until started

var _dt := 0.0
var _shapes := {}  # by a collider's number, from the shape's axes to those of its resource
var _followed := []


func _ready() -> void:
    process_priority = AFTER_OTHERS
    set_physics_process(false)
    if autostart and world_file != "":
        start()


func _physics_process(delta: float) -> void:
    step(delta)


# Load the world file: takes seconds. Returns whether it could be done.
func start() -> bool:
    stop()
    var fresh: Reference = Native.new()
    if fresh.load(ProjectSettings.globalize_path(world_file)) == null:
        return false
    native = fresh
    for body in _physics_bodies():
        _follow(body)
    native.changes()
    set_physics_process(true)
    emit_signal("started")
    return true


# Give the world back. Bodies are no more.
func stop() -> void:
    set_physics_process(false)
    native = null
    _dt = 0.0
    _shapes.clear()
    _followed.clear()


# One step of `delta` seconds; called in each physics frame.
func step(delta: float) -> bool:
    if not _is_started("step") or not _set_step(delta):
        return false
    for each in _followed.duplicate():
        _move(each)
    # Godot has made its own step. It gets what the bodies give in this one with its next.
    if native.advance(delta) == null:
        return false
    for each in _followed:
        _push_back(each)
    var changes: Array = native.changes()
    for i in range(0, changes.size(), 3):
        match changes[i + 2]:
            Status.ASLEEP:
                emit_signal("body_slept", changes[i])
            Status.FROZEN:
                emit_signal("body_froze", changes[i])
            Status.ACTIVE:
                emit_signal("body_woke", changes[i])
    return true


# The body of that name in the script of the world; 0 for none.
func body(body_name: String) -> int:
    if not _is_started("body"):
        return 0
    var slot = native.find(Kind.BODY, body_name)
    return 0 if slot == null else native.body(slot)


# A new body; 0 where that is refused.
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


# Be there at the end of the coming step. `which` is a name of the world's script or a number of add_collider.
func move_collider(which, place: Transform) -> bool:
    var number := _collider(which, "move_collider")
    return number >= 0 and native.move_collider(number, place * _shapes.get(number, Transform())) != null


# A collider of one of Godot's shapes; returns its number, or -1 where that is refused.
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
        turn.basis = Basis(Vector3.RIGHT, PI / 2)  # Godot's lies along z, the library's along y
    elif shape is PlaneShape:
        kind = Shape.PLANE
        turn = _above(shape.plane)
    else:
        push_error("%s is no SphereShape, BoxShape, CapsuleShape or PlaneShape" % shape)
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
    _shapes.erase(number)
    return _is_started("remove_collider") and native.remove_collider(number) != null


# What bodies gave it in the last step [N s].
func collider_impulse(which) -> Vector3:
    var number := _collider(which, "collider_impulse")
    var found = null if number < 0 else native.collider_impulse(number)
    return Vector3() if found == null else found[0]


# Tells states apart: that of Python's world in the same state. (Object has a function hash already.)
func state_hash() -> String:
    return "" if not _is_started("state_hash") else native.state_hash()


# The soft bodies and their colliders; Godot's own bodies are not in it.
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


func _collider(which, what: String) -> int:
    if not _is_started(what):
        return -1
    var number = which
    if which is String:
        number = native.find(Kind.COLLIDER, which)
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
    # The picture is alpha of the way from the step before to the last one. With nearly a step of time put in
    # here it stays that of the last step, where Godot draws its own bodies.
    return native.advance(NEARLY * delta) != null


# From a plane to axes whose y stands on it.
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
        children.invert()  # so that they come out in the order of the scene
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
        if number >= 0 and not body is StaticBody:
            _followed.append(
                {
                    "body": weakref(body),
                    "shape": weakref(shape),
                    "number": number,
                    "place": shape.global_transform,
                    "last": [Vector3(), Vector3()],
                }
            )


func _move(each: Dictionary) -> void:
    var shape: CollisionShape = each.shape.get_ref()
    if shape == null or not shape.is_inside_tree():
        remove_collider(each.number)
        _followed.erase(each)
        return
    var place := shape.global_transform
    var rigid := each.body.get_ref() as RigidBody
    if rigid != null:
        # Under Bullet the node itself is one step behind; then soft and rigid bodies would gain energy.
        var state := PhysicsServer.body_get_direct_state(rigid.get_rid())
        if state != null:
            place = state.transform * shape.transform
    if place != each.place:
        each.place = place
        move_collider(each.number, place)


# The engine feels an impulse one step late. So it gets half of it in advance, and that is taken back later:
# the page docs/coupling.md says why.
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
