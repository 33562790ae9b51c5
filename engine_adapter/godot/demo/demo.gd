# Sets the materials of the demo, drops an elephant when space is pressed, and lets the mouse drag soft bodies.
extends Node3D

const ELEPHANT := "res://elephant.glb"  # a copy of assets/elephant.glb, from which world.py makes bodies

var _hand := 0  # the current grab, or 0
var _depth := 0.0  # distance of the grab in front of the camera [m]
var _plush := _colored(Color(0.72, 0.72, 0.78))
var _dropped := 0


func _ready() -> void:
    if FileAccess.file_exists(ELEPHANT):
    # Godot 3: if File.new().file_exists(ELEPHANT):
        _plush = _colored(Color(0.8, 0.8, 0.8))
        _plush.albedo_texture = _texture_of(ELEPHANT)
    $World/Rider.material_override = _plush
    $World/Block.material_override = _colored(Color(0.85, 0.4, 0.25))
    $World/Crate/Mesh.material_override = _colored(Color(0.55, 0.38, 0.22))
    $World/Platform/Mesh.material_override = _colored(Color(0.25, 0.4, 0.5))
    $World/Ground/Mesh.material_override = _colored(Color(0.5, 0.55, 0.45))


func _unhandled_key_input(event: InputEvent) -> void:
# Godot 3: func _unhandled_key_input(event: InputEventKey) -> void:
    var key := event as InputEventKey
    if key != null and key.pressed and not key.echo and key.keycode == KEY_SPACE:
        # Next to the previous elephant, which may not have moved away.
        if drop(Transform3D(Basis(), Vector3(0.55 * _dropped - 0.45, 2.0, 0.2))) != null:
            _dropped += 1


func _unhandled_input(event: InputEvent) -> void:
    var button := event as InputEventMouseButton
    if button != null and button.button_index == MOUSE_BUTTON_LEFT:
        if button.pressed:
            take_hold(button.position)
        else:
            let_go()
    elif event is InputEventMouseMotion and _hand != 0:
        if not $World.move_grab(_hand, $Camera.project_position(event.position, _depth)):
            _hand = 0  # the body was removed


# Grab the soft body that is visible at a point of the window.
func take_hold(place: Vector2) -> void:
    let_go()
    var camera: Camera3D = $Camera
    var hit: Dictionary = $World.raycast(
        camera.project_ray_origin(place), camera.project_ray_normal(place)
    )
    if not hit.is_empty():
        _hand = $World.grab(hit)
        _depth = -camera.to_local(hit.point).z


func let_go() -> void:
    if _hand != 0:
        $World.release_grab(_hand)
    _hand = 0


# Spawn an elephant. Return the node that draws it; null if the world has no free slot.
func drop(place: Transform3D) -> TaichiSoftBody:
    var body: int = $World.spawn("elephant", place)
    if body == 0:
        return null
    var drawn := TaichiSoftBody.new()
    drawn.body = body
    drawn.material_override = _plush
    $World.add_child(drawn)
    return drawn


func _colored(color: Color) -> StandardMaterial3D:
    var material := StandardMaterial3D.new()
    material.albedo_color = color
    return material


# Load the first image in a .glb file. The file has a header of 12 bytes, a chunk in JSON, and a chunk of binary data.
func _texture_of(path: String) -> ImageTexture:
    var file := FileAccess.open(path, FileAccess.READ)
    # Godot 3: var file := File.new()
    # Godot 3: file.open(path, File.READ)
    file.seek(12)
    var length := file.get_32()
    file.get_32()
    var head: Dictionary = JSON.parse_string(file.get_buffer(length).get_string_from_utf8())
    var view: Dictionary = head.bufferViews[int(head.images[0].bufferView)]
    file.seek(12 + 8 + length + 8 + int(view.get("byteOffset", 0)))
    var bytes := file.get_buffer(int(view.byteLength))
    var image := Image.new()
    if head.images[0].mimeType == "image/png":
        image.load_png_from_buffer(bytes)
    else:
        image.load_jpg_from_buffer(bytes)
    return ImageTexture.create_from_image(image)
    # Godot 3: var texture := ImageTexture.new()
    # Godot 3: texture.create_from_image(image)
    # Godot 3: return texture
