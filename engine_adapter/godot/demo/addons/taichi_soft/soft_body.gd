# Draws a soft body of a SoftWorld. It is called TaichiSoftBody, because Godot has a node SoftBody.
#
# Vertices are in global coordinates, so this node ignores its parent's transform. Set the material with
# material_override.
class_name TaichiSoftBody
extends MeshInstance

# Path of the SoftWorld; empty takes the nearest ancestor.
export var world_path := NodePath()
# Name of the body in the world's script; empty if `body` is set to a result of SoftWorld.spawn.
export var body_name := ""
# Name of the mesh; empty takes the first mesh of the body's asset. A body without a skin uses the mesh of its level of
# detail.
export var mesh_name := ""

var body := 0 setget set_body

var _world: Node
var _mesh := -1
var _level := -1  # level of detail of the mesh; -1 for a skin, which fits all levels
var _arrays := []


func _ready() -> void:
    set_as_toplevel(true)
    global_transform = Transform()
    mesh = ArrayMesh.new()
    _world = get_node_or_null(world_path) if world_path else get_parent()
    while _world != null and not _world.has_method("state_hash"):
        _world = null if world_path else _world.get_parent()
    if _world == null:
        push_error("%s: no ancestor is a SoftWorld, and world_path names none" % name)
    else:
        _world.connect("started", self, "_on_started")
        if _world.native != null:
            _on_started()
    set_process(_world != null)


# Draw another body; 0 draws none.
func set_body(value: int) -> void:
    body = value
    _mesh = -1
    if _world != null and _world.native != null and value != 0:
        _find_mesh()


func _process(_delta: float) -> void:
    draw()


# Update the mesh from the world; called in each frame.
func draw() -> void:
    if _mesh < 0 or _world.native == null:
        return
    var read = _read()
    if read == null:  # the body was removed from the world
        set_body(0)
        mesh = ArrayMesh.new()
        return
    _arrays[Mesh.ARRAY_VERTEX] = read[0]
    _arrays[Mesh.ARRAY_NORMAL] = read[1]
    # Reuse the mesh, which keeps the instance's material.
    if mesh.get_surface_count() > 0:
        mesh.surface_remove(0)
    mesh.add_surface_from_arrays(Mesh.PRIMITIVE_TRIANGLES, _arrays, [], 0)


func _on_started() -> void:
    set_body(_world.body(body_name) if body_name != "" else body)


# Return positions and normals; null if the body was removed from the world.
func _read():
    var native: Reference = _world.native
    if _level >= 0:  # a snapshot can change the level
        var level = native.get_level(body)
        if level != null and level != _level:
            _find_mesh()
        if level == null or _mesh < 0:
            return null
    return native.mesh(body, _mesh)


func _find_mesh() -> void:
    var native: Reference = _world.native
    var asset = native.asset_of(body)
    if asset == null:
        return
    _mesh = _mesh_of(asset, native.get_level(body))
    if _mesh < 0:
        push_error("%s: the body has no mesh with this name" % name)
        return
    _level = native.mesh_info(_mesh)[4]
    var uvs: PoolVector2Array = native.uvs(_mesh)
    _arrays = []
    _arrays.resize(Mesh.ARRAY_MAX)
    _arrays[Mesh.ARRAY_INDEX] = native.triangles(_mesh)
    _arrays[Mesh.ARRAY_TEX_UV] = uvs if uvs.size() > 0 else null


# Return the number of the mesh for a level of detail of an asset; -1 for none.
func _mesh_of(asset: int, level: int) -> int:
    var native: Reference = _world.native
    if mesh_name != "":
        var named = native.find(_world.Kind.MESH, mesh_name)
        if named == null:
            return -1
        var info = native.mesh_info(named)
        if info[0] != asset or info[4] < 0:
            return named
    for number in native.count(_world.Kind.MESH):
        var info = native.mesh_info(number)
        if info[0] == asset and (info[4] < 0 or info[4] == level):
            return number
    return -1
