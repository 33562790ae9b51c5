"""Elements: materials, laws, and the kernels that turn deformation into forces."""
