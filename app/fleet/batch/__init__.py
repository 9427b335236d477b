"""The pipeline on every recording of a fleet, on Dask: what decides the bytes of a batch's tables is in this folder."""
