# A platform that moves back and forth.
extends AnimatableBody3D

@export var reach := 0.6  # [m]
@export var period := 6.0  # [s]

var _time := 0.0
@onready var _middle := transform.origin


func _physics_process(delta: float) -> void:
    _time += delta
    transform.origin = _middle + Vector3(0, 0, reach * (1.0 - cos(TAU * _time / period)) / 2)
