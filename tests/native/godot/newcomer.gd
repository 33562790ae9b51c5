# Plays the scene that a project begins with, and prints how its soft bodies moved, as JSON. Space is pressed once.
extends SceneTree

const FRAMES := 480

var _world: Node
var _frame := 0
var _middles := {}
var _lowest := {}


func _init() -> void:
    change_scene(ProjectSettings.get_setting("application/run/main_scene"))


func _iteration(_delta: float) -> bool:
    _frame += 1
    if _frame == 10:
        var event := InputEventKey.new()
        event.scancode = KEY_SPACE
        event.pressed = true
        Input.parse_input_event(event)
    if _world == null and current_scene != null:
        _world = _world_below(current_scene)
    if _world != null and _world.native != null:
        for drawn in _world.get_children():
            if drawn.has_method("set_body"):
                _note(drawn)
    if _frame == FRAMES:
        print("JSON ", to_json({"name": "middles", "value": _middles}))
        print("JSON ", to_json({"name": "lowest", "value": _lowest}))
        quit()
    return false


func _world_below(node: Node) -> Node:
    for child in node.get_children():
        if child.has_method("state_hash"):
            return child
    return null


func _note(drawn: MeshInstance) -> void:
    var middle: Vector3 = _world.native.center(drawn.body)
    if not drawn.name in _middles:
        _middles[drawn.name] = []
        _lowest[drawn.name] = []
    _middles[drawn.name].append([middle.x, middle.y, middle.z])
    if drawn.mesh.get_surface_count() > 0:
        _lowest[drawn.name].append(drawn.mesh.get_aabb().position.y)
