"""What an element does: materials, laws, and the kernels that turn deformation into forces."""
