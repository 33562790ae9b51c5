"""Bodies that are cut, and that tear by themselves."""
