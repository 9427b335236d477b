"""/api/fleet: search the tables of a fleet."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, HTTPException, Query
from pydantic import Field

from app.drive.events import event_kinds
from app.fleet.desk import FleetDesk
from app.web.refusals import refusing
from app.web.routes.shapes.common import ApiModel

MOST_ROWS, LONGEST_CONDITION = 1000, 4000
TableName = Literal["events", "frames", "objects", "drives"]
SqlCondition = Annotated[str, Query(max_length=LONGEST_CONDITION)]
ColumnName = Annotated[str, Query(min_length=1, max_length=60)]
RunName = Annotated[str | None, Query(max_length=60)]


class FleetJson(ApiModel):
    """The fleet that the dashboard was started with."""

    address: str | None
    """Folder of the batch; null without a fleet."""
    runs: list[str]
    """Names of all runs, the last batch's first."""
    about: dict[str, str]
    """By run: parameters and sensors that differ from the default, in a line."""
    kinds: list[str]
    """Kinds of event, each a boolean column of ``events``."""
    named: dict[str, str]
    """Named conditions on ``events``, and what they stand for."""


class FleetRows(ApiModel):
    """What was found."""

    run: str
    """Name of the run."""
    columns: list[str]
    """Names, in the order of each row's values."""
    rows: list[list[Any]]
    """At most as many as were asked for; null: unknown."""
    total: int
    """How many there are in all."""


class FleetHistogram(ApiModel):
    """How a column's values are distributed."""

    edges: list[float]
    """One more than counts; empty where there are no values."""
    counts: list[int]
    """Values between two edges."""


class FleetCount(ApiModel):
    """Rows with the same value of a column."""

    value: str | None
    """As text; null: unknown."""
    count: int = Field(ge=1)
    """Rows."""


def fleet_router(fleet: FleetDesk | None) -> APIRouter:
    """Routes for the tables of a fleet; None: the dashboard was started without one."""
    router = APIRouter(prefix="/api/fleet", tags=["fleet"])

    def desk() -> FleetDesk:
        if fleet is None:
            raise HTTPException(404, "no fleet is open; start with `cipv serve SOURCE --fleet DIR`")
        return fleet

    @router.get("")
    def about() -> FleetJson:
        """Get what can be searched."""
        if fleet is None:
            return FleetJson(address=None, runs=[], about={}, kinds=[], named={})
        from app.fleet.find import NAMED

        with refusing():
            about = fleet.about()
        return FleetJson(
            address=fleet.store.address, runs=list(about), about=about, kinds=list(event_kinds()), named=NAMED
        )

    @router.get("/rows")
    def rows(
        of: TableName = "events",
        where: SqlCondition = "",
        run: RunName = None,
        order: Annotated[str, Query(max_length=60)] = "",
        descending: bool = False,
        limit: Annotated[int, Query(ge=1, le=MOST_ROWS)] = 200,
    ) -> FleetRows:
        """List the rows of a table that meet an SQL condition on its columns. order: a column."""
        with refusing():
            name, found = desk().find(run, where, of, limit, order, descending=descending)
        return FleetRows(
            run=name, columns=list(found.columns), rows=[list(row) for row in found.rows], total=found.total
        )

    @router.get("/histogram")
    def histogram(
        column: ColumnName,
        of: TableName = "events",
        where: SqlCondition = "",
        run: RunName = None,
        bins: Annotated[int, Query(ge=1, le=200)] = 24,
    ) -> FleetHistogram:
        """Get the histogram of a numeric column over the rows that meet a condition."""
        with refusing():
            edges, counts = desk().histogram(run, where, of, column, bins)
        return FleetHistogram(edges=edges, counts=counts)

    @router.get("/counts")
    def counts(
        column: ColumnName, of: TableName = "events", where: SqlCondition = "", run: RunName = None
    ) -> list[FleetCount]:
        """Count the values of a column over the rows that meet a condition, the most frequent first."""
        with refusing():
            return [FleetCount(value=value, count=count) for value, count in desk().counts(run, where, of, column)]

    return router
