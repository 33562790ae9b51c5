"""What bodies hit."""
