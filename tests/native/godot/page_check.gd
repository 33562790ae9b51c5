# The script of docs/godot.md on the demo's scene.
extends SceneTree

var _main: Spatial
var _nodes := 0
var _frame := 0


func _init() -> void:
    _main = load("res://main.tscn").instance()
    _nodes = _main.get_node("World").get_child_count()
    _main.set_script(load("res://page.gd"))
    get_root().add_child(_main)


func _iteration(_delta: float) -> bool:
    _frame += 1
    if _frame == 20:
        var world := _main.get_node("World")
        var last := world.get_child(world.get_child_count() - 1)
        var found := {
            "nodes": world.get_child_count() - _nodes,
            "vertices": last.mesh.surface_get_array_len(0),
            "height": world.native.center(last.body).y,
        }
        print("JSON ", to_json({"name": "page", "value": found}))
        quit()
    return false
