"""What a body is: asset, layout, fields, and what follows from its material."""
