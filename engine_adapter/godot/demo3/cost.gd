# Measures the time to read and draw the demo's elephant: godot3-server --path FOLDER --fixed-fps 60 -s cost.gd
extends SceneTree

const TIMES := 200

var _main: Spatial
var _frame := 0


func _init() -> void:
    _main = load("res://main.tscn").instance()
    get_root().add_child(_main)


func _idle(_delta: float) -> bool:
    _frame += 1
    if _frame == 30:
        _measure(_main.get_node("World"), _main.get_node("World/Rider"))
        quit()
    return false


func _measure(world: Spatial, drawn: MeshInstance) -> void:
    var reading := []
    var drawing := []
    for _i in TIMES:
        world.step(1.0 / 60)
        var start := OS.get_ticks_usec()
        world.native.mesh(drawn.body, drawn._mesh)
        reading.append(OS.get_ticks_usec() - start)
        start = OS.get_ticks_usec()
        drawn.draw()
        drawing.append(OS.get_ticks_usec() - start)
    for each in [reading, drawing]:
        each.sort()
    print(
        "%d vertices: reading %d us, reading and drawing %d us, least of %d (median %d and %d)"
        % [
            drawn.mesh.surface_get_array_len(0),
            reading[0],
            drawing[0],
            TIMES,
            reading[TIMES / 2],
            drawing[TIMES / 2]
        ]
    )
