# The scripts of docs/godot.md on the demo's scene.
extends SceneTree

var _main: Spatial
var _nodes := 0
var _frame := 0
var _found := {}


func _init() -> void:
    _main = load("res://main.tscn").instance()
    _nodes = _main.get_node("World").get_child_count()
    _main.set_script(load("res://page.gd"))
    get_root().add_child(_main)


func _iteration(_delta: float) -> bool:
    _frame += 1
    var world := _main.get_node("World")
    var last := world.get_child(world.get_child_count() - 1)
    var middle: Vector3 = world.native.center(last.body)
    var camera: Camera = _main.get_node("Camera")
    match _frame:
        20:
            _found["nodes"] = world.get_child_count() - _nodes
            _found["vertices"] = last.mesh.surface_get_array_len(0)
            _found["height"] = middle.y
            _press(camera.unproject_position(middle), true)
        22:
            _found["held"] = _main.hand != 0
            _found["hand"] = middle.y
            var event := InputEventMouseMotion.new()
            event.position = camera.unproject_position(middle)
            Input.parse_input_event(event)
        80:
            _found["pulled"] = middle.y
            _press(Vector2(), false)
        82:
            _found["let_go"] = _main.hand == 0
            _found["hook"] = middle.y
            _main.hang_up(last.body, Transform(Basis(), middle))
        200:
            _found["hangs"] = middle.y
            print("JSON ", to_json({"name": "page", "value": _found}))
            quit()
    return false


func _press(place: Vector2, is_pressed: bool) -> void:
    var event := InputEventMouseButton.new()
    event.button_index = BUTTON_LEFT
    event.position = place
    event.pressed = is_pressed
    Input.parse_input_event(event)
