"""Who is near whom, and what passes between them."""
