# Draws a soft body of a SoftWorld. The name is TaichiSoftBody, because Godot already has a node SoftBody.
#
# Vertices are in world coordinates, so this node ignores its parent's transform. Set `material_override` to change the
# material.
class_name TaichiSoftBody
extends MeshInstance3D

## Path of the SoftWorld. If empty, the node uses the nearest SoftWorld among its ancestors.
@export var world_path := NodePath()
## Name of the body in the world's script. Leave it empty if you set `body` to a result of SoftWorld.spawn.
@export var body_name := ""
## Name of the mesh. If empty, the first mesh of the body's asset is drawn. Without a skin, this mesh depends on the
## level of detail.
@export var mesh_name := ""

var body := 0:
    set = set_body

var _world: SoftWorld = null
var _drawn := ArrayMesh.new()
var _mesh := -1
var _level := -1  # level of detail that the mesh draws; -1 for a skin, which draws all levels
var _arrays := []


func _ready() -> void:
    top_level = true
    # Godot 3: set_as_toplevel(true)
    global_transform = Transform3D()
    mesh = _drawn
    _world = _find_world()
    if _world == null:
        push_error("%s: no SoftWorld is above it or at world_path" % name)
    else:
        _world.started.connect(_on_started)
        if _world.native != null:
            _on_started()
    set_process(_world != null)


## Draw another body. With 0, draw no body.
func set_body(value: int) -> void:
    body = value
    _mesh = -1
    if _world != null and _world.native != null and value != 0:
        _find_mesh()


func _process(_delta: float) -> void:
    draw()


## Update the mesh with the body's current shape. The node calls this in each frame.
func draw() -> void:
    if _mesh < 0 or _world.native == null:
        return
    var read = _read()
    _drawn.clear_surfaces()  # reuse the mesh, because a new one would reset the instance's material
    # Godot 3: if _drawn.get_surface_count() > 0:
    # Godot 3:     _drawn.surface_remove(0)
    if read == null:  # the body was removed from the world
        set_body(0)
        return
    _arrays[Mesh.ARRAY_VERTEX] = read[0]
    _arrays[Mesh.ARRAY_NORMAL] = read[1]
    _drawn.add_surface_from_arrays(Mesh.PRIMITIVE_TRIANGLES, _arrays)
    # Godot 3: _drawn.add_surface_from_arrays(Mesh.PRIMITIVE_TRIANGLES, _arrays, [], 0)


func _find_world() -> SoftWorld:
    var node: Node = get_parent() if world_path.is_empty() else get_node_or_null(world_path)
    while node != null and not node is SoftWorld:
    # Godot 3: while node != null and not node.has_method("state_hash"):
        node = node.get_parent() if world_path.is_empty() else null
    return node as SoftWorld


func _on_started() -> void:
    set_body(_world.body(body_name) if body_name != "" else body)


# Return positions and normals; null if the body was removed from the world.
func _read():
    var native: RefCounted = _world.native
    if _level >= 0:  # restoring a snapshot can also change the level
        var level = native.get_level(body)
        if level != null and level != _level:
            _find_mesh()
        if level == null or _mesh < 0:
            return null
    return native.mesh(body, _mesh)


func _find_mesh() -> void:
    var native: RefCounted = _world.native
    var asset = native.asset_of(body)
    if asset == null:
        return
    _mesh = _mesh_of(asset, native.get_level(body))
    if _mesh < 0:
        push_error("%s: the body has no mesh of that name" % name)
        return
    _level = native.mesh_info(_mesh)[4]
    var uvs: PackedVector2Array = native.uvs(_mesh)
    _arrays = []
    _arrays.resize(Mesh.ARRAY_MAX)
    _arrays[Mesh.ARRAY_INDEX] = native.triangles(_mesh)
    _arrays[Mesh.ARRAY_TEX_UV] = uvs if uvs.size() > 0 else null


# Return the number of the mesh that draws a level of detail of an asset; -1 if there is none.
func _mesh_of(asset: int, level: int) -> int:
    var native: RefCounted = _world.native
    if mesh_name != "":
        var named = native.find(SoftWorld.Kind.MESH, mesh_name)
        if named == null:
            return -1
        var info = native.mesh_info(named)
        if info[0] != asset or info[4] < 0:
            return named
    for number in native.count(SoftWorld.Kind.MESH):
        var info = native.mesh_info(number)
        if info[0] == asset and (info[4] < 0 or info[4] == level):
            return number
    return -1
