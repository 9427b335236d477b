"""The optional packages of the extra ``fleet``."""

from __future__ import annotations

from importlib.util import find_spec

from pipeline.common.errors import BadInput

PACKAGES = ("dask", "distributed", "fsspec", "pyarrow", "duckdb")
"""Names to import of what the extra brings."""


def need_extra() -> None:
    """Raise BadInput if the extra is not installed."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        raise BadInput(f"{', '.join(missing)} not installed; `make install` installs the extra `fleet`")
