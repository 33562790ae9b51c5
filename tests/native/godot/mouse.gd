# Plays the demo's scene: the mouse takes hold of the elephant on the platform, pulls it up and lets it go. Prints
# heights as JSON.
extends SceneTree

var _main: Spatial
var _world: Spatial
var _frame := 0
var _found := {}


func _init() -> void:
    _main = load("res://main.tscn").instance()
    get_root().add_child(_main)
    _world = _main.get_node("World")


func _iteration(_delta: float) -> bool:
    _frame += 1
    var camera: Camera = _main.get_node("Camera")
    var rider: int = _world.body("rider")
    var middle: Vector3 = _world.native.center(rider)
    match _frame:
        120:
            _found["before"] = middle.y
            _press(camera.unproject_position(middle), true)
        122:
            _found["hand"] = _main._hand != 0
            var event := InputEventMouseMotion.new()
            event.position = camera.unproject_position(middle + Vector3(0, 0.8, 0))
            _found["place"] = (middle + Vector3(0, 0.8, 0)).y
            Input.parse_input_event(event)
        300:
            _found["held"] = middle.y
            _press(Vector2(), false)
        420:
            _found["after"] = middle.y
            _press(Vector2(2, 2), true)  # at the sky
        422:
            _found["sky"] = _main._hand != 0
            print("JSON ", to_json({"name": "mouse", "value": _found}))
            quit()
    return false


func _press(place: Vector2, is_pressed: bool) -> void:
    var event := InputEventMouseButton.new()
    event.button_index = BUTTON_LEFT
    event.position = place
    event.pressed = is_pressed
    Input.parse_input_event(event)
