"""MCAP files: a directory of what lies where, chunks read by need, and files that are whole at any time."""
