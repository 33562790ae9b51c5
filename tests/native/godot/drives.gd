# Gravity, friction, joints and motors by the functions of soft_world.gd: prints as JSON what bodies do. The world is
# `joined`, in which z is up: bodies 0 to 3 are crates in two stacks, 5 to 7 are bars of 1 m along x.
extends SceneTree

const DT := 1.0 / 64
const STILL := Vector3()
const DOWN := Vector3(0, 0, -9.81)

var _world: Spatial
var _start := PoolByteArray()
var _bar := 0


func _init() -> void:
    _world = load("res://addons/taichi_soft/soft_world.gd").new()
    _world.world_file = "res://joined.softworld"
    get_root().add_child(_world)
    _world.set_physics_process(false)
    _bar = _world.body("body7")
    _start = _world.snapshot()
    _fall()
    _slide_on_the_floor()
    _slide_on_each_other()
    _hang()
    _turn()
    _name()
    quit()


func _say(name: String, what) -> void:
    print("JSON ", to_json({"name": name, "value": what}))


func _list(vector: Vector3) -> Array:
    return [vector.x, vector.y, vector.z]


func _step(count: int) -> void:
    for _i in count:
        _world.step(DT)


func _middle(body: int) -> Vector3:
    return _world.native.center(body)


# Vertices of a body on one side of its middle.
func _side(body: int, direction: Vector3) -> PoolIntArray:
    var found := PoolIntArray()
    var places: PoolVector3Array = _world.positions(body)
    var most := -INF
    for place in places:
        most = max(most, direction.dot(place))
    for i in places.size():
        if direction.dot(places[i]) > most - 1e-3:
            found.append(i)
    return found


# For half a second, upwards.
func _fall() -> void:
    var answer: bool = _world.set_gravity(Vector3(1, -2, 4))
    var before := _middle(_bar)
    _step(32)
    _say("fall", {"answer": answer, "moved": _list(_middle(_bar) - before)})
    _world.restore(_start)
    _world.set_gravity(DOWN)


# A bar on the floor gets 1 m/s along y, and has a second.
func _slide_on_the_floor() -> void:
    _step(100)
    var kept: PoolByteArray = _world.snapshot()
    var found := []
    for friction in [0.0, 0.2, 0.4]:
        _world.restore(kept)
        var answer: bool = _world.set_collider_friction("collider1", friction)
        _world.native.set_velocity(_bar, Vector3(0, 1, 0), STILL)
        var before := _middle(_bar)
        _step(64)
        found.append({"answer": answer, "moved": _list(_middle(_bar) - before)})
    _say("floor", found)
    _world.restore(_start)
    _world.set_gravity(DOWN)


# A crate that lies on another one gets 0.5 m/s along x, and has 0.6 s.
func _slide_on_each_other() -> void:
    var lower: int = _world.body("body0")
    var found := []
    for friction in [0.0, 1.0]:
        _world.restore(_start)
        _world.despawn(_world.body("body2"))
        var upper: int = _world.spawn("asset0", Transform(Basis(), Vector3(0, 0, 0.5)))
        var answers := [_world.set_body_friction(lower, friction), _world.set_body_friction(upper, friction)]
        _step(40)
        _world.native.set_velocity(upper, Vector3(0.5, 0, 0), STILL)
        _step(40)
        found.append({"answers": answers, "apart": _list(_middle(upper) - _middle(lower))})
    _say("stack", found)
    _world.restore(_start)
    _world.set_gravity(DOWN)


# A crate hangs from a bar that a frame holds.
func _hang() -> void:
    var all := PoolIntArray(range(_world.positions(_bar).size()))
    var frame: int = _world.add_frame(Transform(Basis(), _middle(_bar)))
    _world.attach(_bar, all, frame)
    _world.move_frame(frame, Transform(Basis(), _middle(_bar) + Vector3(0, 0, 1)))
    _step(1)
    var crate: int = _world.spawn("asset0", Transform(Basis(), _middle(_bar) - Vector3(0, 0, 0.26)))
    var top := _side(crate, Vector3(0, 0, 1))
    var joint: int = _world.join(crate, top, _bar)
    var before := _middle(crate)
    _step(300)
    var force := Vector3()
    for _i in 64:
        _step(1)
        force += _world.joint_force(joint) / 64
    var found := {"vertices": top.size(), "force": _list(force), "sank": before.z - _middle(crate).z}
    found["listed"] = _world.joint(1) == joint
    found["released"] = [_world.release_joint(joint), _world.release_joint(joint)]
    _step(20)
    found["fell"] = before.z - _middle(crate).z
    # Four vertices of the crate at four of the bar, however far apart they are.
    var low := _side(_bar, Vector3(0, 0, -1))
    low.resize(4)
    top.resize(4)
    joint = _world.join(crate, top, _bar, low)
    _step(200)
    var places: PoolVector3Array = _world.positions(crate)
    var there: PoolVector3Array = _world.positions(_bar)
    found["onto"] = 0.0
    for i in 4:
        found["onto"] = max(found["onto"], places[top[i]].distance_to(there[low[i]]))
    _say("hang", found)
    _world.restore(_start)


# A bar that floats is turned about its own length.
func _turn() -> void:
    _world.set_gravity(STILL)
    var end := _side(_bar, Vector3(1, 0, 0))
    var motor: int = _world.add_motor(_bar, end, Vector3(1, 0, 0), 3.0, 40.0)
    var found := {"vertices": end.size(), "listed": _world.motor(1) == motor}
    _step(128)
    found["speed"] = _speed(end)
    found["answers"] = [_world.set_motor_speed(motor, -2.0)]
    _step(128)
    found["back"] = _speed(end)
    found["answers"].append(_world.set_motor_limit(motor, 0.0))
    found["answers"].append(_world.set_motor_speed(motor, 9.0))
    _step(64)
    found["coasts"] = _speed(end)
    found["removed"] = [_world.remove_motor(motor), _world.remove_motor(motor), _world.motor(1)]
    found["gone"] = [_world.set_motor_speed(motor, 1.0), _world.set_motor_limit(motor, 1.0)]
    _say("turn", found)
    _world.restore(_start)


# Angular velocity about x of some vertices in a step, by where they are before and after it [rad/s].
func _speed(vertices: PoolIntArray) -> float:
    var before: PoolVector3Array = _world.positions(_bar)
    _step(1)
    var after: PoolVector3Array = _world.positions(_bar)
    var middles := [Vector3(), Vector3()]
    for i in vertices:
        middles[0] += before[i] / vertices.size()
        middles[1] += after[i] / vertices.size()
    var found := 0.0
    for i in vertices:
        var from: Vector3 = before[i] - middles[0]
        var to: Vector3 = after[i] - middles[1]
        found += Vector2(from.y, from.z).angle_to(Vector2(to.y, to.z)) / vertices.size()
    return found / DT


# Of the script that made the world.
func _name() -> void:
    var joint: int = _world.joint("joint0")
    var motor: int = _world.motor("motor0")
    var found := {"there": joint > 0 and motor > 0, "numbers": [_world.joint(0) == joint, _world.motor(0) == motor]}
    found["nobody"] = [_world.joint("nobody"), _world.motor("nobody")]
    found["nobody"].append(_world.add_motor(0, PoolIntArray(), STILL, 1.0, 1.0))
    found["set"] = [_world.set_body_friction(0, 0.5), _world.set_collider_friction("nobody", 0.5)]
    _say("names", found)
