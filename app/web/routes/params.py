"""/api/params: the parameters, their values, and changing them."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, get_args, get_origin

import msgspec
import numpy as np
from fastapi import APIRouter, HTTPException, Query, Response
from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

from app.engine.engine import Engine
from app.labels.acts.request_fields import PersonOrNobody
from app.web.refusals import refusing
from app.web.routes.shapes.common import ApiModel, file_of
from app.web.routes.shapes.parameters import ParamsJson
from pipeline.alignment.projection import angular_from_calibration
from pipeline.params import PRESETS, Params, ParamsError, flat, preset, to_yaml, with_changes
from pipeline.types import REAL_VEHICLES, Frame

_ANSWER: dict[int | str, dict[str, Any]] = {200: {"model": ParamsJson}}


class Step(ApiModel):
    """A change of parameters that can be undone."""

    person: PersonOrNobody = Field("", description="Who can undo the change; anyone without a name")


class Changes(Step):
    """New values by dotted name; null, where permitted, means the value of the calibration or the detector."""

    changes: dict[str, Any] = Field(min_length=1, examples=[{"cluster.z_weight": 0.4}])
    """At least one."""
    final: bool = Field(
        True, description="False while a slider is dragged: no undo step, and no run over the whole drive"
    )


class Replacement(Step):
    """A preset, and the values that differ from it."""

    preset: str = Field("default", examples=list(PRESETS))
    """Which values to start from."""
    values: dict[str, Any] = Field(default_factory=dict, examples=[{"cluster.z_weight": 0.4}])
    """Those that differ from the preset."""


class PresetChoice(Step):
    """A preset's name."""

    name: str = Field(examples=list(PRESETS))
    """One of ``presets``."""


def params_router(engine: Engine) -> APIRouter:
    """Routes for the engine's parameters."""
    router = APIRouter(prefix="/api", tags=["parameters"])

    @router.get("/params", responses=_ANSWER)
    def read(person: Annotated[PersonOrNobody, Query()] = "") -> Response:
        """List all parameters with bounds, step, unit, help and values, and what null stands for now. can_undo,
        can_redo: for this person, across labels and parameters."""
        return _params_json(engine, person)

    @router.patch("/params", responses=_ANSWER)
    def change(body: Changes) -> Response:
        """Change some parameters. The shown frame is rerun at once. 422 for an invalid value."""
        try:
            engine.control.change_params(body.changes, final=body.final, person=body.person)
        except ParamsError as error:
            raise HTTPException(422, str(error)) from None
        return _params_json(engine, body.person)

    @router.post("/params", responses=_ANSWER)
    def replace_all(body: Replacement) -> Response:
        """Replace all parameters. Values that are not given are those of the preset."""
        try:
            params = with_changes(preset(body.preset), body.values)
            engine.control.set_params(params, body.preset, person=body.person)
        except ParamsError as error:
            raise HTTPException(422, str(error)) from None
        return _params_json(engine, body.person)

    @router.post("/params/undo", responses=_ANSWER)
    def undo() -> Response:
        """Undo the last anonymous change of parameters. 409 when there is none. The dashboard uses POST
        /api/labels/undo, which covers labels and parameters."""
        with refusing():
            engine.labels.move("undo", "", engine.labels.drive)
        return _params_json(engine)

    @router.post("/params/redo", responses=_ANSWER)
    def redo() -> Response:
        """Redo the change that was undone last. 409 when there is none."""
        with refusing():
            engine.labels.move("redo", "", engine.labels.drive)
        return _params_json(engine)

    @router.post("/params/preset", responses=_ANSWER)
    def choose_preset(body: PresetChoice) -> Response:
        """Load a preset. Replaces all parameters."""
        try:
            engine.control.set_params(preset(body.name), body.name, person=body.person)
        except ParamsError as error:
            raise HTTPException(422, str(error)) from None
        return _params_json(engine, body.person)

    @router.get("/params.yaml", response_class=Response, responses=file_of("application/yaml"))
    def download() -> Response:
        """Download the parameters as a file for `cipv run --params`."""
        headers = {"content-disposition": 'attachment; filename="cipv-params.yaml"'}
        return Response(to_yaml(engine.control.peek().params), media_type="application/yaml", headers=headers)

    return router


def describe() -> list[dict[str, Any]]:
    """Every section: name, help and its parameters, in order of declaration."""
    return [
        {
            "name": name,
            "help": _help(field),
            "params": [_describe_one(key, inner) for key, inner in _section_fields(field).items()],
        }
        for name, field in Params.model_fields.items()
    ]


def effective(frame: Frame | None, params: Params) -> dict[str, float]:
    """The value that None stands for in each parameter, from the shown frame's calibration and its detector's distance
    law."""
    boxes = frame.raw_boxes if frame is not None else None
    law = (boxes.law if boxes is not None else REAL_VEHICLES).at_focal(params.distance.reference_focal_px)
    answer = {
        "distance.coefficient": round(law.coefficient, 1),
        "distance.exponent": round(law.exponent, 4),
        "distance.truck_ratio": round(law.truck_ratio, 3),
        "distance.bus_ratio": round(law.bus_ratio, 3),
        "distance.motorcycle_ratio": round(law.motorcycle_ratio, 3),
    }
    if frame is None or frame.camera is None:
        return answer
    model = angular_from_calibration(frame.camera)
    return answer | {
        "alignment.h_res_deg": round(float(np.degrees(model.h_res_rad)), 5),
        "alignment.v_res_deg": round(float(np.degrees(model.v_res_rad)), 5),
        "alignment.cx_px": round(model.cx, 1),
        "alignment.cy_px": round(model.cy, 1),
    }


def _params_json(engine: Engine, person: str = "") -> Response:
    """Built while the user waits for the rerun of the shown frame, so the constant part is encoded only once."""
    wish, processed = engine.control.peek(), engine.snapshot.processed
    can_undo, can_redo = engine.labels.possible(person)
    answer = {
        "preset": wish.preset,
        "presets": list(PRESETS),
        "revision": wish.params_revision,
        "can_undo": can_undo,
        "can_redo": can_redo,
        "sections": _sections(),
        "values": flat(wish.params),
        "base": _base(wish.preset),
        "effective": effective(processed.frame if processed else None, wish.params),
    }
    return Response(msgspec.json.encode(answer), media_type="application/json")


@cache
def _sections() -> msgspec.Raw:
    return msgspec.Raw(msgspec.json.encode(describe()))


@cache
def _base(name: str) -> msgspec.Raw:
    return msgspec.Raw(msgspec.json.encode(flat(preset(name))))


def _section_fields(field: FieldInfo) -> dict[str, FieldInfo]:
    assert isinstance(field.annotation, type)
    assert issubclass(field.annotation, BaseModel)
    return field.annotation.model_fields


def _help(field: FieldInfo) -> str:
    return " ".join((getattr(field.annotation, "__doc__", None) or "").split())


def _describe_one(key: str, field: FieldInfo) -> dict[str, Any]:
    """One parameter: its kind is number, integer, boolean or choice."""
    allowed = get_args(field.annotation) if get_origin(field.annotation) else (field.annotation,)
    kinds = [kind for kind in allowed if kind is not type(None)]
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    described: dict[str, Any] = {"key": key, "help": field.description or "", "nullable": type(None) in allowed}
    if kinds[0] is bool:
        return {**described, "kind": "boolean"}
    if isinstance(kinds[0], str):
        return {**described, "kind": "choice", "choices": kinds}
    bounds = {name: getattr(item, name) for item in field.metadata for name in ("ge", "le") if hasattr(item, name)}
    return {
        **described,
        "kind": "integer" if kinds[0] is int else "number",
        "min": bounds.get("ge"),
        "max": bounds.get("le"),
        "step": extra.get("step"),
        "unit": extra.get("unit", ""),
    }
