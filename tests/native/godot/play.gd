# Plays a recorded game, `game.txt`, on the demo's world, and prints what engine_adapter/native/tests/play.c prints.
extends SceneTree

var _native: Reference
var _numbers := []
var _kept := PoolByteArray()


func _init() -> void:
    _native = load("res://addons/taichi_soft/soft_world_native.gdns").new()
    _native.load(ProjectSettings.globalize_path("res://demo.softworld"))
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
        "snapshot":
            _kept = _native.snapshot()
        "restore":
            _native.restore(_kept)
        "status":
            _say(_native.status(_body()))
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


# FNV-1a over words of 4 bytes.
func _hash(rows: PoolVector3Array) -> String:
    var stream := StreamPeerBuffer.new()
    stream.data_array = var2bytes(rows)
    stream.seek(8)  # behind kind and size
    var code := -3750763034362895579
    for _i in 3 * rows.size():
        code = (code ^ stream.get_u32()) * 1099511628211
    return "%08x%08x" % [(code >> 32) & 0xffffffff, code & 0xffffffff]
