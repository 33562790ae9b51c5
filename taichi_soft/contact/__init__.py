"""What bodies touch: colliders, and each other."""
