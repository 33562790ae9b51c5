# Plays a recorded game, `game.txt`, which begins with the name of its world. Prints what
# engine_adapter/native/tests/play.c prints.
extends SceneTree

var _native: Reference
var _numbers := []
var _kept := PoolByteArray()


func _init() -> void:
    _native = load("res://addons/taichi_soft/soft_world_native.gdns").new()
    var file := File.new()
    file.open("res://game.txt", File.READ)
    while not file.eof_reached():
        var words := Array(file.get_line().split(" ", false))
        if words:
            var call: String = words.pop_front()
            _numbers = words
            _play(call)
    quit()


func _play(call: String) -> void:
    match call:
        "world":
            _native.load(ProjectSettings.globalize_path("res://" + _numbers.pop_front()))
        "step":
            var dt := _number()
            _native.step(dt, int(_number()))
            _say(_native.state_hash())
        "add_collider":
            var kind := int(_number())
            var size := _vector()
            var surface := []
            for _i in 5:
                surface.append(_number())
            _say(
                _native.add_collider(
                    kind, size, _place(), surface[0], surface[1], surface[2], int(surface[3]), int(surface[4])
                )
            )
        "move_collider":
            var number := int(_number())
            _native.move_collider(number, _place())
        "spawn":
            var asset := int(_number())
            var place := _place()
            var velocity := _vector()
            _native.spawn(asset, place, velocity, _vector())
        "despawn":
            _native.despawn(_body())
        "velocity":
            var body := _body()
            var velocity := _vector()
            _native.set_velocity(body, velocity, _vector())
        "impulse":
            var body := _body()
            _native.apply_impulse(body, _vector())
        "wake":
            _native.wake()
        "set_level":
            var body := _body()
            var level := int(_number())
            _native.set_level(body, level, int(_number()))
        "level":
            var body := _body()
            _say("%d %d" % [_native.get_level(body), _native.vertex_count(body)])
        "record_events":
            _native.record_events(int(_number()))
        "drain":
            var events: Array = _native.drain_events()
            _say("events %d" % (events.size() / 8))
            for i in range(0, events.size(), 8):
                var row := [events[i + 7], events[i + 4].x, events[i + 4].y, events[i + 4].z, events[i + 5]]
                var who := [_slot(events[i + 1]), _slot(events[i + 2]), _hash_of(row)]
                _say("%d %d %d %d %d %s" % ([events[i], events[i + 3], events[i + 6]] + who))
        "raycast":
            var origin := _vector()
            var direction := _vector()
            _say_hit(_native.raycast(origin, direction, _number()))
        "overlap_sphere":
            var center := _vector()
            _say_bodies(_native.overlap_sphere(center, _number()))
        "overlap_box":
            var place := _place()
            _say_bodies(_native.overlap_box(place, _vector()))
        "grab":
            var body := _body()
            var triangle := int(_number())
            var weights := _vector()
            var point := _vector()
            var frequency := _number()
            _native.grab(body, triangle, weights, point, frequency, _number())
        "move_grab":
            var grab := _grab()
            _native.move_grab(grab, _vector())
        "release_grab":
            _native.release_grab(_grab())
        "grab_force":
            _say(_hash_of(_parts([_native.grab_force(_grab())])))
        "gravity":
            _native.set_gravity(_vector())
        "body_friction":
            var body := _body()
            _native.set_body_friction(body, _number())
        "collider_friction":
            var collider := int(_number())
            _native.set_collider_friction(collider, _number())
        "join":
            var body := _body()
            var vertices := _list()
            var other := _body()
            _say(_slot(_native.join(body, vertices, other, _list())))
        "joint_force":
            _say(_hash_of(_parts([_native.joint_force(_native.joint_of(int(_number())))])))
        "release_joint":
            _native.release_joint(_native.joint_of(int(_number())))
        "add_motor":
            var body := _body()
            var vertices := _list()
            var kind := [int(_number()), int(_number()), int(_number())]
            var axis := _vector()
            var point := _vector()
            var speed := _number()
            _say(_slot(_native.add_motor(body, vertices, kind[0], kind[1], kind[2], axis, point, speed, _number())))
        "motor_speed":
            var motor: int = _native.motor_of(int(_number()))
            _native.set_motor_speed(motor, _number())
        "motor_limit":
            var motor: int = _native.motor_of(int(_number()))
            _native.set_motor_limit(motor, _number())
        "motor_state":
            _say(_hash_of(_native.motor_state(_native.motor_of(int(_number())))))
        "remove_motor":
            _native.remove_motor(_native.motor_of(int(_number())))
        "add_frame":
            _say(_native.add_frame(_place()))
        "remove_frame":
            _native.remove_frame(int(_number()))
        "move_frame":
            var number := int(_number())
            _native.move_frame(number, _place())
        "attach":
            var body := _body()
            var vertices := _list()
            var frame := int(_number())
            _native.attach(body, vertices, frame, int(_number()))
        "detach":
            var body := _body()
            _native.detach(body, _list())
        "load":
            var body := _body()
            _say(_hash_of(_parts(_native.frame_load(body, int(_number())))))
        "snapshot":
            _kept = _native.snapshot()
        "restore":
            _native.restore(_kept)
        "status":
            _say(_native.status(_body()))
        "positions":
            _say(_hash(_native.positions(_body())))
        "collider_impulse":
            _say(_hash_of(_parts(_native.collider_impulse(int(_number())))))
        "mesh":
            var body := _body()
            var read: Array = _native.mesh(body, int(_number()))
            _say("%s %s" % [_hash(read[0]), _hash(read[1])])


func _say(what) -> void:
    print("PLAY ", what)


func _number() -> float:
    return float(_numbers.pop_front())


func _vector() -> Vector3:
    var x := _number()
    var y := _number()
    return Vector3(x, y, _number())


func _place() -> Transform:
    var origin := _vector()
    var axis := _vector()
    return Transform(Basis(Quat(axis.x, axis.y, axis.z, _number())), origin)


func _body() -> int:
    return _native.body(int(_number()))


func _list() -> PoolIntArray:
    var found := PoolIntArray()
    for _i in int(_number()):
        found.append(int(_number()))
    return found


func _grab() -> int:
    return _native.grab_of(int(_number()))


func _slot(body: int) -> int:
    return (body & 0xffffffff) - 1


func _say_hit(hit: Array) -> void:
    if not hit:
        _say("nothing")
        return
    var row := [hit[2]] + _parts([hit[5], hit[3], hit[4]])
    _say("%d %d %d %d %s" % ([_slot(hit[0])] + Array(hit[6]) + [_hash_of(row)]))


func _say_bodies(bodies: Array) -> void:
    var slots := []
    for body in bodies:
        slots.append(str(_slot(body)))
    _say(PoolStringArray(slots).join(" ") if slots else "nothing")


func _parts(vectors: Array) -> Array:
    var found := []
    for each in vectors:
        found += [each.x, each.y, each.z]
    return found


func _hash(rows: PoolVector3Array) -> String:
    var stream := StreamPeerBuffer.new()
    stream.data_array = var2bytes(rows)
    stream.seek(8)  # behind kind and size
    return _hash_of_words(stream, 3 * rows.size())


func _hash_of(numbers: Array) -> String:
    var stream := StreamPeerBuffer.new()
    for number in numbers:
        stream.put_float(number)
    stream.seek(0)
    return _hash_of_words(stream, numbers.size())


# FNV-1a over words of 4 bytes.
func _hash_of_words(stream: StreamPeerBuffer, count: int) -> String:
    var code := -3750763034362895579
    for _i in count:
        code = (code ^ stream.get_u32()) * 1099511628211
    return "%08x%08x" % [(code >> 32) & 0xffffffff, code & 0xffffffff]
