"""Parameters are declared once, checked always, and survive the way to a file and back."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.params import PRESETS, Params, ParamsError, from_yaml, preset, to_yaml, with_changes


def test_every_number_has_bounds_a_step_and_a_sentence() -> None:
    schema = Params.model_json_schema()
    for section in schema["$defs"].values():
        for name, field in section["properties"].items():
            assert field.get("description"), name
            options = field.get("anyOf", [field])
            for option in options:
                if option.get("type") in ("number", "integer"):
                    assert "minimum" in option, name
                    assert "maximum" in option, name
                    assert "step" in field, name


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_survives_its_file(name: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(to_yaml(preset(name)), encoding="utf-8")
    assert from_yaml(file, Params()) == preset(name)


def test_presets_differ_where_the_paper_does() -> None:
    paper, default = preset("paper"), preset("default")
    assert paper.alignment.model == "angular"
    assert paper.distance.binning
    assert not default.distance.binning


def test_changes_touch_only_what_they_name() -> None:
    changed = with_changes(Params(), {"cluster.z_weight": 0.7})
    assert changed.cluster.z_weight == 0.7
    assert changed.model_copy(update={"cluster": Params().cluster}) == Params()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        pytest.param(
            {"cluster.z_wait": 0.4}, "no parameter named 'cluster.z_wait'; did you mean cluster.z_weight", id="misspelt"
        ),
        pytest.param({"clusters.z_weight": 0.4}, "no parameter named", id="no such section"),
        pytest.param({"cluster": 0.4}, "no parameter named", id="a section is not a parameter"),
        pytest.param({"cluster.z_weight": 7.0}, "cluster.z_weight: ", id="out of bounds"),
        pytest.param({"cluster.z_weight": float("nan")}, "cluster.z_weight: ", id="not a number"),
        pytest.param({"cluster.z_weight": "much"}, "cluster.z_weight: ", id="a word"),
        pytest.param({"alignment.model": "fisheye"}, "alignment.model: ", id="no such choice"),
    ],
)
def test_bad_changes_are_named(change: dict[str, object], complaint: str) -> None:
    with pytest.raises(ParamsError, match=complaint):
        with_changes(Params(), change)


@pytest.mark.parametrize(
    "text",
    ["- a list", "cluster: 3", "cluster: {z_weight: [", "\x00\x01", "cluster: {unknown: 1}"],
)
def test_bad_files_are_named(text: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ParamsError):
        from_yaml(file, Params())


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ParamsError, match=r"nowhere\.yaml"):
        from_yaml(tmp_path / "nowhere.yaml", Params())


def test_unknown_preset() -> None:
    with pytest.raises(ParamsError, match="no preset named 'fast'; there are default, paper"):
        preset("fast")
