"""Going back and forth through the parameters that were settled on. Values only; whoever holds them replaces them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from pipeline.params import Params

_LONGEST = 100


class Setting(NamedTuple):
    """All parameters and the preset they started from."""

    params: Params
    preset: str


@dataclass(frozen=True)
class History:
    """now: what was settled on last. merges: the parameters whose next change belongs to the same step."""

    now: Setting
    past: tuple[Setting, ...] = ()
    future: tuple[Setting, ...] = ()
    merges: frozenset[str] = frozenset()

    def settle(self, to: Setting, merges: frozenset[str] = frozenset()) -> History:
        """A step further, which ends what could be redone. ``merges`` non-empty and the same as the step before's: that
        step becomes this one."""
        if to == self.now:
            return replace(self, now=to)
        same_step = bool(merges) and merges == self.merges and bool(self.past)
        past = self.past if same_step else (*self.past, self.now)[-_LONGEST:]
        return History(to, past, (), merges)

    def back(self) -> History | None:
        """A step back; null when there is none."""
        return History(self.past[-1], self.past[:-1], (self.now, *self.future)) if self.past else None

    def forth(self) -> History | None:
        """A step that was taken back, again; null when there is none."""
        return History(self.future[0], (*self.past, self.now), self.future[1:]) if self.future else None
