"""Sliders, switches and choices for every parameter in the 3D view, generated from the parameter schema."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import viser

from pipeline.params import Params

OnChange = Callable[[str, Any], None]


class ParamsGui:
    """One folder per section, all closed at first; a parameter that may be None has an "auto" switch before its slider.
    ``on_change(name, value)`` is called with a dotted name when the user changes something, but not by ``set``."""

    def __init__(self, gui: viser.GuiApi, params: Params, on_change: OnChange) -> None:
        self._gui = gui
        self._on_change = on_change
        self._inputs: dict[str, Any] = {}
        self._autos: dict[str, Any] = {}
        self._known: dict[str, Any] = {}
        schema = Params.model_json_schema()
        values = params.model_dump()
        with gui.add_folder("Parameters", expand_by_default=False):
            for section, entry in schema["properties"].items():
                declared = schema["$defs"][entry["$ref"].rpartition("/")[2]]
                with gui.add_folder(_words(section), expand_by_default=False):
                    for key, spec in declared["properties"].items():
                        self._add(f"{section}.{key}", spec, values[section][key])

    @property
    def names(self) -> tuple[str, ...]:
        """The dotted names of all parameters with an input."""
        return tuple(self._inputs)

    def set(self, params: Params) -> None:
        """Show these values in all browsers, without calling ``on_change``. Only differences are written: otherwise a
        slider that the user has just moved, whose ``on_change`` is still pending, would jump back and the change would
        be lost."""
        for section, values in params.model_dump().items():
            for key, value in values.items():
                name = f"{section}.{key}"
                if value != self._known[name]:
                    self._show(name, value)

    def _show(self, name: str, value: Any) -> None:
        self._known[name] = value
        auto = self._autos.get(name)
        if auto is not None:
            auto.value = value is None
            self._inputs[name].disabled = value is None
        if value is not None:
            self._inputs[name].value = value

    def _add(self, name: str, spec: Mapping[str, Any], value: Any) -> None:
        label, hint = _label(name, spec), spec.get("description", "")
        if "anyOf" in spec:
            auto = self._gui.add_checkbox(f"{label} auto", value is None, hint="Use the calibration's value")
            self._autos[name] = auto
            auto.on_update(lambda event: self._auto_moved(name, event))
        handle = self._input(label, hint, spec, value)
        self._inputs[name] = handle
        self._known[name] = value
        handle.on_update(lambda event: self._moved(name, event))

    def _input(self, label: str, hint: str, spec: Mapping[str, Any], value: Any) -> Any:
        if "enum" in spec:
            return self._gui.add_dropdown(label, spec["enum"], initial_value=value, hint=hint)
        if spec.get("type") == "boolean":
            return self._gui.add_checkbox(label, value, hint=hint)
        bounds = next(each for each in spec.get("anyOf", [spec]) if "minimum" in each)
        low, high = bounds["minimum"], bounds["maximum"]
        start = value if value is not None else low
        number = int if bounds["type"] == "integer" else float
        return self._gui.add_slider(
            label, number(low), number(high), number(spec["step"]), number(start), hint=hint, disabled=value is None
        )

    def _moved(self, name: str, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            if name in self._autos:
                self._autos[name].value = False
            self._tell(name, event.target.value)

    def _auto_moved(self, name: str, event: viser.GuiEvent[Any]) -> None:
        if event.client_id is not None:
            handle = self._inputs[name]
            handle.disabled = bool(event.target.value)
            self._tell(name, None if event.target.value else handle.value)

    def _tell(self, name: str, value: Any) -> None:
        self._known[name] = value
        self._on_change(name, value)


_UNIT_SUFFIXES = frozenset({"m", "px", "deg", "s", "mps", "mps2", "kmh"})
"""Name suffixes that state the unit."""


def _words(name: str) -> str:
    """``lidar_tracking`` → ``Lidar tracking``."""
    return name.replace("_", " ").capitalize()


def _label(name: str, spec: Mapping[str, Any]) -> str:
    """``path.half_width_m`` → ``Half width (m)``: with the unit in its usual notation."""
    key, unit = name.partition(".")[2], spec.get("unit", "")
    stem, _, last = key.rpartition("_")
    return f"{_words(stem if stem and last in _UNIT_SUFFIXES else key)} ({unit})" if unit else _words(key)
