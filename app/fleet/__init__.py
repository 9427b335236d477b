"""Many recordings: the pipeline run on all of them, its results as tables, and questions to these tables.

What is imported here and not elsewhere comes with the extra ``fleet``: Dask, pyarrow and DuckDB."""
