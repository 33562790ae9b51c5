# Levels of detail by the nodes: prints as JSON what is drawn, what is refused, and what is released. In the world
# `levels` bodies 0 and 1 are balls with a skin, at levels 0 and 1, and bodies 3 and 4 are bars without a skin.
extends SceneTree

const LEVELS := [0, 2, 1, 1, 0, 2]
const World := preload("res://addons/taichi_soft/soft_world.gd")
const Drawn := preload("res://addons/taichi_soft/soft_body.gd")

var _world := World.new()
var _ball := 0
var _bar := 0


func _init() -> void:
    var early := World.new()
    _say("early", [early.set_level(1, 0), early.get_level(1), early.level_count(1)])
    early.free()
    _world.world_file = "res://levels.softworld"
    get_root().add_child(_world)
    _world.set_physics_process(false)
    _ball = _world.body("body0")
    _bar = _world.body("body3")
    var other: int = _world.body("body1")
    _say("counts", [_world.level_count(_ball), _world.level_count(_bar), _world.level_count(7)])
    _say("levels", [_world.get_level(_ball), _world.get_level(other), _world.get_level(7)])
    _draw()
    _refuse()
    _rewind()
    _look_from_afar()
    quit()


func _say(name: String, what) -> void:
    print("JSON ", to_json({"name": name, "value": what}))


func _step(count: int) -> void:
    for _i in count:
        _world.step(1.0 / 64)


func _drawn(body: int, mesh_name := "") -> MeshInstance:
    var found: MeshInstance = Drawn.new()
    found.body = body
    found.mesh_name = mesh_name
    _world.add_child(found)
    return found


# What is in the mesh of a node.
func _look(drawn: MeshInstance) -> Dictionary:
    drawn.draw()
    if drawn.mesh.get_surface_count() == 0:
        return {}
    var arrays: Array = drawn.mesh.surface_get_arrays(0)
    var vertices: PoolVector3Array = arrays[Mesh.ARRAY_VERTEX]
    var indices: PoolIntArray = arrays[Mesh.ARRAY_INDEX]
    var places := {}  # an edge that is drawn sharp has several vertices in one place
    var volume := 0.0
    for vertex in vertices:
        places[vertex] = true
    for i in range(0, indices.size(), 3):
        var a := vertices[indices[i]]
        volume += a.dot((vertices[indices[i + 2]] - a).cross(vertices[indices[i + 1]] - a)) / 6
    return {
        "level": _world.get_level(drawn.body),
        "own": _world.positions(drawn.body).size(),
        "apart": _apart(places.keys(), _world.positions(drawn.body)),
        "places": places.size(),
        "triangles": indices.size() / 3,
        "normals": arrays[Mesh.ARRAY_NORMAL].size() == vertices.size(),
        "volume": volume,
    }


# The largest distance from a place to the nearest vertex.
func _apart(places: Array, vertices: PoolVector3Array) -> float:
    var found := 0.0
    for place in places:
        var least := INF
        for vertex in vertices:
            least = min(least, vertex.distance_squared_to(place))
        found = max(found, least)
    return sqrt(found)


func _draw() -> void:
    var bar := _drawn(_bar)
    var named := _drawn(_bar, "asset1.surface1")
    var ball := _drawn(_ball)
    var found := []
    for level in LEVELS:
        var answers := [_world.set_level(_bar, level), _world.set_level(_ball, level)]
        found.append({"answers": answers, "bar": _look(bar), "named": _look(named), "ball": _look(ball)})
        _step(3)
        found.append({"answers": [], "bar": _look(bar), "named": _look(named), "ball": _look(ball)})
    _say("drawn", found)


func _refuse() -> void:
    var bar := _drawn(_bar)
    var found := {"beyond": _try(bar, 3), "below": _try(bar, -1)}
    var joint: int = _world.join(_bar, PoolIntArray([0, 1]), _ball, PoolIntArray([2, 3]))
    found["joined"] = _try(bar, 1)
    _say("refused", found)
    _say(
        "released",
        {
            "was": _world.joint(0) == joint and joint > 0,
            "answer": _world.set_level(_bar, 1, true),
            "drawn": _look(bar),
            "joint": _world.joint(0),
        }
    )
    _say("nobody", [_world.set_level(12345, 0), _world.last_error()])


# A call that has to be refused, and whether anything is another one after it.
func _try(bar: MeshInstance, level: int) -> Dictionary:
    var before := [_world.state_hash(), _world.snapshot(), _world.positions(_bar), _look(bar)]
    var answer: bool = _world.set_level(_bar, level)
    var error: String = _world.last_error()
    var after := [_world.state_hash(), _world.snapshot(), _world.positions(_bar), _look(bar)]
    var are_same := true
    for i in before.size():
        are_same = are_same and to_json(before[i]) == to_json(after[i])
    return {"answer": answer, "error": error, "are_same": are_same}


# A snapshot has the level, too, and a body that comes into the slot begins at the finest.
func _rewind() -> void:
    var bar := _drawn(_bar)
    _world.set_level(_bar, 0)
    var kept: PoolByteArray = _world.snapshot()
    _world.set_level(_bar, 2)
    var found := [_look(bar)]
    _world.restore(kept)
    found.append(_look(bar))
    _world.set_level(_bar, 2)
    _look(bar)
    _world.despawn(_bar)
    found.append(_look(bar))
    bar.body = _world.spawn("asset1", Transform(Basis(), Vector3(4, 0, 1)))
    found.append(_look(bar))
    _say("rewind", found)


# By the script of the page, which asks for the camera.
func _look_from_afar() -> void:
    var page: Spatial = load("res://page_levels.gd").new()
    var camera := Camera.new()
    page.world = _world
    page.add_child(camera)
    get_root().add_child(page)
    var found := []
    for distance in [1, 15, 25, 500, 0]:
        camera.translation = _world.native.center(_ball) + Vector3(0, distance, 0)
        page.choose_level(_ball)
        found.append(_world.get_level(_ball))
    _say("afar", found)
