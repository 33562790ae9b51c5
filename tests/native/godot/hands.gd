# What bodies tell, and what holds them: prints it as JSON. The world is the demo's; on the ground lie an elephant and
# a block.
extends SceneTree

const DT := 1.0 / 60

var _world: Spatial
var _ground := StaticBody.new()
var _told := []
var _rider := 0
var _block := 0


func _init() -> void:
    var shape := CollisionShape.new()
    shape.shape = PlaneShape.new()
    _ground.name = "Ground"
    _ground.add_child(shape)
    _world = load("res://addons/taichi_soft/soft_world.gd").new()
    _world.world_file = "res://demo.softworld"
    _world.add_child(_ground)
    get_root().add_child(_world)
    _world.set_physics_process(false)
    _rider = _world.body("rider")
    _block = _world.body("block")
    _step(30)
    _say("unheard", {"recorded": _world._recorded, "events": _world.native.drain_events().size()})
    for told_by in _world.TOLD_BY:
        _world.connect(told_by, self, "_on_" + told_by)
    _step(240)
    _say("fallen", {"told": _taken()})
    _lift()
    _ask()
    _sleep_and_wake()
    _hang()
    _meet()
    _take_the_ground_away()
    quit()


func _say(name: String, what: Dictionary) -> void:
    print("JSON ", to_json({"name": name, "value": what}))


func _list(vector: Vector3) -> Array:
    return [vector.x, vector.y, vector.z]


func _name(body: int) -> String:
    return {_rider: "rider", _block: "block"}.get(body, "other")


func _on_contact_began(body: int, collider: int, node: Node, impulse: Vector3) -> void:
    _told.append(["began", _name(body), collider, node.name if node != null else "", _list(impulse)])


func _on_contact_ended(body: int, collider: int, node: Node, impulse: Vector3, duration: float) -> void:
    _told.append(["ended", _name(body), collider, node.name if node != null else "", _list(impulse), duration])


func _on_soft_contact_began(body: int, other: int, impulse: Vector3) -> void:
    _told.append(["met", _name(body), _name(other), _list(impulse)])


func _on_soft_contact_ended(body: int, other: int, impulse: Vector3, duration: float) -> void:
    _told.append(["parted", _name(body), _name(other), _list(impulse), duration])


func _on_body_slept(body: int) -> void:
    _told.append(["slept", _name(body)])


func _on_body_woke(body: int) -> void:
    _told.append(["woke", _name(body)])


func _on_body_froze(body: int) -> void:
    _told.append(["froze", _name(body)])


func _taken() -> Array:
    var found := _told
    _told = []
    return found


func _step(count: int) -> void:
    for _i in count:
        _world.step(DT)


func _middle(body: int) -> Vector3:
    return _world.native.center(body)


func _until_asleep(body: int) -> void:
    for _i in 600:
        if _world.native.status(body) == _world.Status.ASLEEP:
            return
        _step(1)


func _held_point(hit: Dictionary) -> Vector3:
    var places: PoolVector3Array = _world.positions(hit.body)
    var found := Vector3()
    for i in 3:
        found += hit.weights[i] * places[hit.vertices[i]]
    return found


func _lift() -> void:
    var block := _middle(_block)
    var mass := _mass(_rider)
    var start := _middle(_rider) + Vector3(0, 2, 0)
    var hit: Dictionary = _world.raycast(start, Vector3(0, -3, 0))
    var is_point: float = hit.point.distance_to(_held_point(hit))
    var grab: int = _world.grab(hit)
    var hand: Vector3 = hit.point + Vector3(0.3, 1.0, 0.2)
    _world.move_grab(grab, hand)
    _step(240)
    var force := Vector3()
    for _i in 60:
        _step(1)
        force += _world.grab_force(grab) / 60
    var found := {
        "is_rider": hit.body == _rider,
        "from_point": is_point,
        "height": start.y - hit.distance - hit.point.y,
        "from_hand": hand.distance_to(_held_point(hit)),
        "block_moved": block.distance_to(_middle(_block)),
        "force": _list(force),
        "mass": mass,
        "told": _taken(),
    }
    found["released"] = [_world.release_grab(grab), _world.release_grab(grab), _world.move_grab(grab, hand)]
    _step(120)
    found["after"] = _taken()
    _say("lift", found)


# By a push: it was asked of nothing else.
func _mass(body: int) -> float:
    var kept: PoolByteArray = _world.snapshot()
    _world.native.set_velocity(body, Vector3(), Vector3())
    _world.native.apply_impulse(body, Vector3(0, 1, 0))
    var before := _middle(body)
    _world.native.step(1e-4, 1)
    var speed := (_middle(body) - before).y / 1e-4
    _world.restore(kept)
    return 1.0 / speed


func _ask() -> void:
    var rider := _middle(_rider)
    var block := _middle(_block)
    var aside := Transform(Basis(Vector3.UP, PI / 4), block + Vector3(0.75, 0, 0))
    _say(
        "overlaps",
        {
            "sphere": [_names(_world.overlap_sphere(rider, 0.05)), _names(_world.overlap_sphere(block, 0.05))],
            "all": _names(_world.overlap_sphere((rider + block) / 2, 3.0)),
            "none": _names(_world.overlap_sphere((rider + block) / 2, 0.3)),
            # The block's side is 0.25 m away, and half the diagonal of these boxes is 0.28 m and 0.21 m.
            "box": [
                _names(_world.overlap_box(aside, Vector3(0.4, 0.4, 0.4))),
                _names(_world.overlap_box(aside, Vector3(0.3, 0.3, 0.3))),
                _names(_world.overlap_box(Transform(Basis(), aside.origin), Vector3(0.4, 0.4, 0.4))),
            ],
            "ray": _world.raycast(block + Vector3(0, 3, 0), Vector3(0, -2, 0), 2.0).size(),
            "up": _world.raycast(block + Vector3(0, 3, 0), Vector3(0, 1, 0)).size(),
        }
    )


func _names(bodies: Array) -> Array:
    var found := []
    for body in bodies:
        found.append(_name(body))
    return found


func _sleep_and_wake() -> void:
    _until_asleep(_block)
    _taken()
    _world.native.apply_impulse(_block, Vector3(0, 50, 0))
    _step(1)
    var woke := _taken()
    _until_asleep(_block)
    _say("sleep", {"woke": woke, "slept": _taken()})


func _hang() -> void:
    var top := PoolIntArray()
    var places: PoolVector3Array = _world.positions(_rider)
    for i in places.size():
        if places[i].y > _middle(_rider).y:
            top.append(i)
    var frame: int = _world.add_frame(Transform(Basis(), _middle(_rider)))
    var before := _middle(_rider)
    _taken()
    var found := {"frame": frame, "attached": _world.attach(_rider, top, frame, true)}
    for i in 60:
        _world.move_frame(frame, Transform(Basis(), before + Vector3(0, 0.01 * (i + 1), -0.005 * (i + 1))))
        _step(1)
    _step(120)
    found["moved"] = _list(_middle(_rider) - before)
    var load_on := Vector3()
    for _i in 60:
        _step(1)
        load_on += _world.frame_load(_rider, frame) / 60
    found["load"] = _list(load_on)
    found["pose"] = _list(_world.native.frame_pose(frame).origin - before)
    found["told"] = _taken()
    found["removed"] = [_world.remove_frame(frame), _world.remove_frame(frame)]
    _step(120)
    found["fell"] = (_middle(_rider) - before).y
    found["after"] = _taken()
    frame = _world.add_frame(Transform())
    _world.attach(_rider, top, frame)
    _world.move_frame(frame, Transform(Basis(), Vector3(0, 0.2, 0)))
    _step(60)
    found["held"] = (_middle(_rider) - before).y
    found["detached"] = [_world.detach(_rider), _world.detach(_rider, PoolIntArray([0]))]
    _step(120)
    found["fell_again"] = (_middle(_rider) - before).y
    _world.remove_frame(frame)
    _say("hang", found)


func _meet() -> void:
    _taken()
    var other: int = _world.spawn("elephant", Transform(Basis(), _middle(_block) + Vector3(0, 0.6, 0)))
    _step(90)
    var met := _taken()
    _world.despawn(other)
    _step(1)
    _say("meet", {"met": met, "parted": _taken()})


# Its number is given to another collider at once.
func _take_the_ground_away() -> void:
    var shape := SphereShape.new()
    _taken()
    var removed: bool = _world.remove_collider(0)
    var number: int = _world.add_collider(shape, Transform(Basis(), Vector3(0, 50, 0)))
    _world.native.wake()
    _step(2)
    var told := _taken()
    _ground.free()
    _world.remove_collider(number)
    number = _world.add_collider(shape, Transform(Basis(), _middle(_block) - Vector3(0, 1.2, 0)))
    _step(60)
    _say("taken", {"removed": removed, "number": number, "told": told, "later": _taken()})
    for told_by in _world.TOLD_BY:
        _world.disconnect(told_by, self, "_on_" + told_by)
    _world.connect("body_woke", self, "_on_body_woke")
    _world.connect("soft_contact_ended", self, "_on_soft_contact_ended")
    _step(1)
    _say("heard", {"recorded": _world._recorded})
