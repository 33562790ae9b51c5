"""What a world file has kernels for that Python does otherwise."""
