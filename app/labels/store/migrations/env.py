"""The environment that Alembic expects: the open database connection, and the target tables."""

from __future__ import annotations

from alembic import context

from app.labels.store.tables import Base

context.configure(
    connection=context.config.attributes["connection"], target_metadata=Base.metadata, transactional_ddl=False
)
context.run_migrations()
