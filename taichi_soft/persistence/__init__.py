"""State as bytes: snapshots, and recordings of calls."""
