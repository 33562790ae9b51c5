"""All that passes from one step to the next, packed into one array, and hashed."""
