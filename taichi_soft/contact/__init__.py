"""Contact of bodies with colliders and with each other."""
