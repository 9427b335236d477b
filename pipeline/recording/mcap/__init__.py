"""MCAP files: an index of their contents, chunks read on demand, and files that are always readable."""
