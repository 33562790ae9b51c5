"""Scenes of contact, each with criteria that a simulation must meet."""

from lab.contact.run import Outcome, run_scene
from lab.contact.scene import Scene, Stage
from lab.contact.scenes import SCENES

__all__ = ["SCENES", "Outcome", "Scene", "Stage", "run_scene"]
