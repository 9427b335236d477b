"""What Alembic asks for: the connection that the database was opened with, and the tables as they should be."""

from __future__ import annotations

from alembic import context

from app.labels.store.tables import Base

context.configure(
    connection=context.config.attributes["connection"], target_metadata=Base.metadata, transactional_ddl=False
)
context.run_migrations()
