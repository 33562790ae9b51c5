# Calls that have to be refused: prints for each its answer and the error, as JSON.
extends SceneTree


func _init() -> void:
    var native: Reference = load("res://addons/taichi_soft/soft_world_native.gdns").new()
    var found := {}
    _try(found, native, "load", ["no/such/folder"])
    _try(found, native, "state_hash", [])
    native.load(ProjectSettings.globalize_path("res://demo.softworld"))
    var upright := Transform()
    _try(found, native, "status", [12345])
    _try(found, native, "despawn", ["rider"])
    _try(found, native, "step", [1.0 / 60])
    _try(found, native, "advance", [-1.0])
    _try(found, native, "advance", [NAN])
    _try(found, native, "spawn", [99, upright, Vector3(), Vector3()])
    _try(found, native, "spawn", [0, Transform(Basis(), Vector3(NAN, 0, 0)), Vector3(), Vector3()])
    _try(found, native, "move_collider", [0, upright.scaled(Vector3(1, 1, -1))])
    _try(found, native, "teleport_collider", [0, upright.scaled(Vector3(0, 0, 0))])
    _try(found, native, "move_frame", [7, upright])
    _try(found, native, "find", [0, "nobody"])
    _try(found, native, "count", [9])
    _try(found, native, "mesh", [native.body(0), 77])
    _try(found, native, "restore", [PoolByteArray([1, 2, 3])])
    _try(found, native, "restore", [PoolByteArray()])
    _try(found, native, "status", [1 << 40])
    _try(found, native, "body", [1 << 40])
    _try(found, native, "record_events", [-1])
    _try(found, native, "raycast", [Vector3(), Vector3(), INF])
    _try(found, native, "overlap_sphere", [Vector3(), -1.0])
    _try(found, native, "overlap_box", [Vector3(), Vector3.ONE])
    _try(found, native, "grab", [native.body(0), 0, Vector3(), Vector3(), 5.0, -1.0])
    _try(found, native, "move_grab", [7, Vector3()])
    _try(found, native, "add_frame", [upright.scaled(Vector3(0, 0, 0))])
    _try(found, native, "attach", [native.body(0), [0], 0, 0])
    _try(found, native, "attach", [native.body(0), PoolIntArray([0]), 0, 0])
    _try(found, native, "detach", [native.body(0), PoolIntArray([1 << 30])])
    _try(found, native, "frame_load", [native.body(0), 0])
    _try(found, native, "positions", [0])
    print("JSON ", to_json({"name": "native", "value": found}))

    var world: Spatial = load("res://addons/taichi_soft/soft_world.gd").new()
    get_root().add_child(world)
    var answers := [world.step(0.1), world.spawn("elephant", upright), world.state_hash(), world.start()]
    world.world_file = "res://demo.softworld"
    answers += [world.start(), world.spawn("nobody", upright), world.body("nobody")]
    answers += [world.move_collider("nobody", upright), world.move_collider(Vector3(), upright)]
    answers += [world.add_collider(ConvexPolygonShape.new(), upright), world.add_collider(null, upright)]
    answers += [world.add_collider(BoxShape.new(), upright.scaled(Vector3(2, 2, 2)))]
    answers += [world.restore(PoolByteArray([1])), world.despawn(3), world.collider_impulse(77)]
    var made := []
    for _i in 9:
        made.append(world.add_collider(SphereShape.new(), Transform(Basis(), Vector3(0, -50, 0))))
    answers += [world.remove_collider(made[3]), world.remove_collider(made[3])]
    made.append(world.add_collider(SphereShape.new(), Transform(Basis(), Vector3(0, -50, 0))))
    answers += [world.step(1.0 / 60)]
    answers += [world.grab({}), world.move_grab(0, Vector3()), world.release_grab(1), world.grab_force(1)]
    answers += [world.attach(3, [0], "hook"), world.move_frame("hook", upright), world.remove_frame(5)]
    answers += [world.detach(world.body("rider")), world.frame_load(world.body("rider"), 0)]
    answers += [world.overlap_sphere(Vector3(NAN, 0, 0), 1.0), world.positions(3), world.raycast(Vector3(), Vector3())]
    print("JSON ", to_json({"name": "node", "value": {"answers": answers, "made": made}}))
    quit()


func _try(found: Dictionary, native: Reference, name: String, arguments: Array) -> void:
    var answer = native.callv(name, arguments)
    found["%d %s" % [found.size(), name]] = [answer == null, native.last_error()]
