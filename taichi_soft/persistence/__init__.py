"""Snapshots of a world as bytes, and recordings of calls and steps."""
