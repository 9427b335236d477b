"""Fleets of recordings: run the pipeline on all of them, write the results as tables, and query these tables. Dask,
pyarrow and DuckDB, which come with the extra ``fleet``, are imported only here."""
