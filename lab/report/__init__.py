"""Report experiments as a page, as files of numbers, and in the terminal."""
