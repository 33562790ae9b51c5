# Materials of the demo. The space key drops another elephant, and the mouse grabs soft bodies.
extends Spatial

const ELEPHANT := "res://elephant.glb"  # copy of assets/elephant.glb, the source of the bodies in world.py

var _hand := 0  # a grab
var _depth := 0.0  # distance of the grab from the camera
var _plush := _colored(Color(0.72, 0.72, 0.78))
var _dropped := 0


func _ready() -> void:
    var file := File.new()
    if file.file_exists(ELEPHANT):
        _plush = _colored(Color(0.8, 0.8, 0.8))
        _plush.albedo_texture = _texture_of(ELEPHANT)
    $World/Rider.material_override = _plush
    $World/Block.material_override = _colored(Color(0.85, 0.4, 0.25))
    $World/Crate/Mesh.material_override = _colored(Color(0.55, 0.38, 0.22))
    $World/Platform/Mesh.material_override = _colored(Color(0.25, 0.4, 0.5))
    $World/Ground/Mesh.material_override = _colored(Color(0.5, 0.55, 0.45))


func _unhandled_key_input(event: InputEventKey) -> void:
    if event.pressed and not event.echo and event.scancode == KEY_SPACE:
        # Next to the previous one, which may still be there.
        if drop(Transform(Basis(), Vector3(0.55 * _dropped - 0.45, 2.0, 0.2))) != null:
            _dropped += 1


func _unhandled_input(event: InputEvent) -> void:
    var button := event as InputEventMouseButton
    if button != null and button.button_index == BUTTON_LEFT:
        if button.pressed:
            grab_at(button.position)
        else:
            release_grab()
    elif event is InputEventMouseMotion and _hand != 0:
        if not $World.move_grab(_hand, $Camera.project_position(event.position, _depth)):
            _hand = 0  # the body was removed


# Grab the soft body at a point of the window.
func grab_at(place: Vector2) -> void:
    release_grab()
    var camera: Camera = $Camera
    var hit: Dictionary = $World.raycast(
        camera.project_ray_origin(place), camera.project_ray_normal(place)
    )
    if not hit.empty():
        _hand = $World.grab(hit)
        _depth = -camera.to_local(hit.point).z


func release_grab() -> void:
    if _hand != 0:
        $World.release_grab(_hand)
    _hand = 0


# Drop another elephant. Returns its node, or null if no slot is free.
func drop(place: Transform) -> TaichiSoftBody:
    var body: int = $World.spawn("elephant", place)
    if body == 0:
        return null
    var drawn := TaichiSoftBody.new()
    drawn.body = body
    drawn.material_override = _plush
    $World.add_child(drawn)
    return drawn


func _colored(color: Color) -> SpatialMaterial:
    var material := SpatialMaterial.new()
    material.albedo_color = color
    return material


# Return the first image in a .glb, which has a header of 12 bytes, a JSON chunk and a binary chunk.
func _texture_of(path: String) -> ImageTexture:
    var file := File.new()
    file.open(path, File.READ)
    file.seek(12)
    var length := file.get_32()
    file.get_32()
    var head: Dictionary = parse_json(file.get_buffer(length).get_string_from_utf8())
    var view: Dictionary = head.bufferViews[head.images[0].bufferView]
    file.seek(12 + 8 + length + 8 + int(view.get("byteOffset", 0)))
    var bytes := file.get_buffer(int(view.byteLength))
    var image := Image.new()
    if head.images[0].mimeType == "image/png":
        image.load_png_from_buffer(bytes)
    else:
        image.load_jpg_from_buffer(bytes)
    var texture := ImageTexture.new()
    texture.create_from_image(image)
    return texture
