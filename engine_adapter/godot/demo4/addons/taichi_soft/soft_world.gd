# A world that `taichi-soft export --axes y-up` wrote, stepped with Godot's own physics. For Godot 4.
#
# Physics bodies below this node, or in the group "soft_colliders", are colliders of the soft bodies, by their
# CollisionShape3Ds: spheres, boxes, capsules and boundaries. Those that move are followed in each physics frame, and
# rigid bodies are pushed. The world file needs room for them: World(collider_room=...).
class_name SoftWorld
extends Node3D

signal started
signal body_slept(which: int)
signal body_woke(which: int)
signal body_froze(which: int)

enum Kind { BODY, ASSET, COLLIDER, FRAME, MESH }
enum Status { ACTIVE, FROZEN, ASLEEP }
enum Shape { PLANE, SPHERE, BOX, CAPSULE }

const NATIVE := "SoftWorldNative"  # the class of taichi_soft.gdextension
const AFTER_OTHERS := 100  # so that what moves bodies comes first
const NEARLY := 1.0 - 1e-6

@export_dir var world_file := ""
@export var autostart := true
## Of a step; 0 for as many as are stable.
@export_range(0, 1000) var substeps := 0
@export_group("Colliders of Godot's shapes")
@export_range(0.0, 2.0, 0.01) var friction := 0.5
## Below 0 for the bodies' own.
@export_range(-1.0, 1.0, 0.01) var restitution := -1.0
@export_range(0.0, 1.0, 0.001) var thickness := 0.0

var native: RefCounted = null  # the functions of SoftWorldNative; null until started

var _dt := 0.0
var _shapes := {}  # by a collider's number, from the shape's axes to those of its resource
var _followed: Array[Dictionary] = []


func _ready() -> void:
    process_physics_priority = AFTER_OTHERS
    set_physics_process(false)
    if autostart and world_file != "":
        start()


func _physics_process(delta: float) -> void:
    step(delta)


## Load the world file: takes seconds. Returns whether it could be done.
func start() -> bool:
    stop()
    if not ClassDB.class_exists(NATIVE):
        push_error("there is no class %s: Godot has not loaded taichi_soft.gdextension" % NATIVE)
        return false
    var fresh: RefCounted = ClassDB.instantiate(NATIVE)
    if fresh.load(ProjectSettings.globalize_path(world_file)) == null:
        return false
    native = fresh
    for node in _physics_bodies():
        _follow(node)
    native.changes()
    set_physics_process(true)
    started.emit()
    return true


## Give the world back. Bodies are no more.
func stop() -> void:
    set_physics_process(false)
    native = null
    _dt = 0.0
    _shapes.clear()
    _followed.clear()


## One step of `delta` seconds; called in each physics frame.
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
                body_slept.emit(changes[i])
            Status.FROZEN:
                body_froze.emit(changes[i])
            Status.ACTIVE:
                body_woke.emit(changes[i])
    return true


## The body of that name in the script of the world; 0 for none.
func body(body_name: String) -> int:
    if not _is_started("body"):
        return 0
    var slot = native.find(Kind.BODY, body_name)
    return 0 if slot == null else native.body(slot)


## A new body; 0 where that is refused.
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


## Be there at the end of the coming step. `which` is a name of the world's script or a number of add_collider.
func move_collider(which: Variant, place: Transform3D) -> bool:
    var number := _collider(which, "move_collider")
    if number < 0:
        return false
    var turn: Transform3D = _shapes.get(number, Transform3D())
    return native.move_collider(number, place * turn) != null


## A collider of one of Godot's shapes; returns its number, or -1 where that is refused.
func add_collider(shape: Resource, place: Transform3D) -> int:
    if not _is_started("add_collider"):
        return -1
    var kind := Shape.SPHERE
    var size := Vector3()
    var turn := Transform3D()
    if shape is SphereShape3D:
        size.x = shape.radius
    elif shape is BoxShape3D:
        kind = Shape.BOX
        size = shape.size
    elif shape is CapsuleShape3D:
        kind = Shape.CAPSULE
        size = Vector3(shape.radius, maxf(shape.height - 2.0 * shape.radius, 0.0), 0.0)  # without its caps
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
    _shapes.erase(number)
    return _is_started("remove_collider") and native.remove_collider(number) != null


## What bodies gave it in the last step [N s].
func collider_impulse(which: Variant) -> Vector3:
    var number := _collider(which, "collider_impulse")
    var found = null if number < 0 else native.collider_impulse(number)
    return Vector3() if found == null else found[0]


## Tells states apart: that of Python's world in the same state.
func state_hash() -> String:
    return native.state_hash() if _is_started("state_hash") else ""


## The soft bodies and their colliders; Godot's own bodies are not in it.
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


func _collider(which: Variant, what: String) -> int:
    if not _is_started(what):
        return -1
    var number = which
    if which is String or which is StringName:
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
        children.reverse()  # so that they come out in the order of the scene
        waiting.append_array(children)
    for node in get_tree().get_nodes_in_group("soft_colliders"):
        if node is PhysicsBody3D and not node in found:
            found.append(node)
    return found


func _follow(physics_body: PhysicsBody3D) -> void:
    # Of Godot's classes the one that moves inherits the one that does not.
    var stays := physics_body is StaticBody3D and not physics_body is AnimatableBody3D
    for shape in physics_body.get_children():
        if not shape is CollisionShape3D or shape.disabled or shape.shape == null:
            continue
        var number := add_collider(shape.shape, shape.global_transform)
        if number >= 0 and not stays:
            _followed.append(
                {
                    "body": weakref(physics_body),
                    "shape": weakref(shape),
                    "number": number,
                    "place": shape.global_transform,
                    "last": [Vector3(), Vector3()],
                }
            )


func _move(each: Dictionary) -> void:
    var shape: CollisionShape3D = each.shape.get_ref()
    if shape == null or not shape.is_inside_tree():
        remove_collider(each.number)
        _followed.erase(each)
        return
    var place := shape.global_transform
    var rigid := each.body.get_ref() as RigidBody3D
    if rigid != null:
        # What the server says, as in Godot 3, where the node could be one step behind.
        var state := PhysicsServer3D.body_get_direct_state(rigid.get_rid())
        if state != null:
            place = state.transform * shape.transform
    if place != each.place:
        each.place = place
        move_collider(each.number, place)


# The engine feels an impulse one step late. So it gets half of it in advance, and that is taken back later:
# the page docs/coupling.md says why.
func _push_back(each: Dictionary) -> void:
    var rigid := each.body.get_ref() as RigidBody3D
    if rigid == null or rigid.freeze:
        return
    var now: Array = native.collider_impulse(each.number)
    var impulse: Vector3 = 1.5 * now[0] - 0.5 * each.last[0]
    var moment: Vector3 = 1.5 * now[1] - 0.5 * each.last[1]
    each.last = now
    if impulse != Vector3() or moment != Vector3():
        var state := PhysicsServer3D.body_get_direct_state(rigid.get_rid())
        var middle := rigid.global_transform.origin if state == null else state.transform.origin
        rigid.apply_impulse(impulse, native.collider_position(each.number) - middle)
        rigid.apply_torque_impulse(moment)
