"""Runs the pipeline on every recording of a fleet, with Dask. All code that determines a batch's tables is here."""
