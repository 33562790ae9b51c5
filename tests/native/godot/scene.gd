# Plays the demo's scene and prints what happens, as JSON.
extends SceneTree

const FRAMES := 420

var _main: Spatial
var _world: Spatial
var _frame := 0
var _slept := []
var _woke := []
var _froze := []
var _rows := []


func _init() -> void:
    _main = load("res://main.tscn").instance()
    get_root().add_child(_main)
    _world = _main.get_node("World")


func _iteration(_delta: float) -> bool:
    _frame += 1
    if _frame == 2:
        _world.connect("body_slept", self, "_on", [_slept])
        _world.connect("body_woke", self, "_on", [_woke])
        _world.connect("body_froze", self, "_on", [_froze])
        _add_capsule()
    if _frame > 2:
        _note()
    if _frame == FRAMES:
        _look_at_meshes()
        _rewind()
        _sleep_and_wake()
        _freeze()
        _say("scene", {"rows": _rows, "froze": _froze.size()})
        quit()
    return false


func _on(body: int, list: Array) -> void:
    list.append(body)


func _say(name: String, what: Dictionary) -> void:
    print("JSON ", to_json({"name": name, "value": what}))


func _list(vector: Vector3) -> Array:
    return [vector.x, vector.y, vector.z]


# Along z, as Godot has it: an elephant above its end falls onto it.
func _add_capsule() -> void:
    var shape := CapsuleShape.new()
    shape.radius = 0.15
    shape.height = 2.0
    var number: int = _world.add_collider(shape, Transform(Basis(), Vector3(0, 1, -4)))
    var drawn = _main.drop(Transform(Basis(), Vector3(0, 1.3, -3.2)))
    _rows.append({"capsule": number, "faller": drawn.body})
    set_meta("capsule", number)


func _note() -> void:
    _rows.append(
        {
            "rider": _list(_world.native.center(_world.body("rider"))),
            "platform": _list(_main.get_node("World/Platform").translation),
            "crate": _list(_main.get_node("World/Crate").translation),
            "push": _list(_world.collider_impulse(_world._followed[1].number)),
            "capsule": _world.collider_impulse(get_meta("capsule")).length(),
        }
    )


func _look_at_meshes() -> void:
    var found := {}
    for name in ["Rider", "Block"]:
        var drawn: MeshInstance = _main.get_node("World/" + name)
        drawn.draw()
        var arrays: Array = drawn.mesh.surface_get_arrays(0)
        var read: Array = _world.native.mesh(drawn.body, drawn._mesh)
        var middle := Vector3()
        var volume := 0.0
        var vertices: PoolVector3Array = arrays[Mesh.ARRAY_VERTEX]
        for vertex in vertices:
            middle += vertex / vertices.size()
        var indices: PoolIntArray = arrays[Mesh.ARRAY_INDEX]
        for i in range(0, indices.size(), 3):
            var a := vertices[indices[i]]
            volume += a.dot((vertices[indices[i + 2]] - a).cross(vertices[indices[i + 1]] - a)) / 6
        found[name] = {
            "vertices": vertices.size(),
            "equal": vertices == read[0] and arrays[Mesh.ARRAY_NORMAL] == read[1],
            "volume": volume,  # above 0 where fronts are clockwise, as in Godot
            "center": _list(middle),
            "top": drawn.mesh.get_aabb().end.y,
            "uvs": arrays[Mesh.ARRAY_TEX_UV].size() if arrays[Mesh.ARRAY_TEX_UV] != null else 0
        }
    _say("meshes", found)


func _rewind() -> void:
    var kept: PoolByteArray = _world.snapshot()
    var before: String = _world.state_hash()
    _world.native.step(1.0 / 60, 0)
    var after: String = _world.state_hash()
    var taken: bool = _world.restore(kept)
    var again: String = _world.state_hash()
    _world.native.step(1.0 / 60, 0)
    _say("rewind", {"taken": taken, "hashes": [before, after, again, _world.state_hash()]})


func _sleep_and_wake() -> void:
    var body: int = _world.body("block")
    for _i in 600:
        if body in _slept:
            break
        _world.step(1.0 / 60)
    _woke.clear()
    _world.native.apply_impulse(body, Vector3(0, 500, 0))
    _world.step(1.0 / 60)
    _say("sleep", {"slept": body in _slept, "woke": body in _woke})


# Spun far faster than steps of this length can follow. Which bodies freeze then, and which are braked, is chance.
func _freeze() -> void:
    _world.substeps = 1
    for _i in 20:
        for name in ["block", "rider"] if _froze.empty() else []:
            _world.native.set_velocity(_world.body(name), Vector3(), Vector3(2000, 0, 2000))
        _world.step(1.0 / 10)
