"""A source whose frames include the planned route."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar, cast

from pipeline.types import Frame, Route
from pipeline.types.source import AnySource, LiveSource, Source, is_simulated

S = TypeVar("S", Source, LiveSource, AnySource)


def along_route(source: S, route: Route | None) -> S:
    """The same source with the route added to every frame; without a route, the source itself."""
    return source if route is None else cast("S", _AlongRoute(source, route))


class _AlongRoute:
    """Everything except frames is delegated to the wrapped source, recording or sensors."""

    def __init__(self, source: Any, route: Route) -> None:
        self._source, self._route = source, route
        self.is_simulated = is_simulated(source)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def __len__(self) -> int:
        return len(self._source)

    def frame(self, index: int) -> Frame:
        return replace(self._source.frame(index), route=self._route)

    def next(self, *args: Any, **kwargs: Any) -> Frame | None:
        frame = self._source.next(*args, **kwargs)
        return replace(frame, route=self._route) if frame is not None else None
