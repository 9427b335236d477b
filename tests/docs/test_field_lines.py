"""Each field of a public type has its own line of documentation: a string under it, or the text that it is declared
with where that is shown to users (a parameter's, an option's, an API field's description)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from tests.docs.pages import ROOT

FIELD_BASES = {"TypedDict", "NamedTuple", "BaseModel", "Struct"}
OPTION_GROUPS = {"SourceOptions", "PipelineOptions", "ServerOptions", "ClusterOptions", "SourceName", "RecordingName"}
"""Options of many commands, which carry their own help."""
FILLERS = {"a", "an", "the", "of", "its", "this", "that", "in", "is", "as", "value", "field"}
UNITS = {"m", "s", "ms", "ns", "px", "deg", "rad", "hz", "mps", "mps2", "mps3", "radps", "kmh", "km", "mb"}
PACKAGES = sorted(path.parent for root in ("pipeline", "app") for path in (ROOT / root).glob("*/__init__.py"))


@cache
def classes(file: Path) -> tuple[ast.ClassDef, ...]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return tuple(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))


def name_of(node: ast.expr) -> str:
    """``field`` of ``dataclasses.field(…)``."""
    if isinstance(node, ast.Call):
        return name_of(node.func)
    if isinstance(node, ast.Subscript):
        return name_of(node.value)
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


@cache
def field_classes() -> frozenset[str]:
    """Names of the classes whose annotated names are fields, because a class above them says so."""
    every = [each for root in ("pipeline", "app") for file in (ROOT / root).rglob("*.py") for each in classes(file)]
    names, before = set(FIELD_BASES), 0
    while len(names) > before:
        before = len(names)
        names |= {each.name for each in every if names & {name_of(base) for base in each.bases}}
    return frozenset(names)


def fields(file: Path) -> Iterator[tuple[str, ast.AnnAssign, str | None]]:
    """(location, field, documentation) of the public types in a file."""
    for each in classes(file):
        is_dataclass = "dataclass" in {name_of(decorator) for decorator in each.decorator_list}
        if each.name.startswith("_") or not (is_dataclass or each.name in field_classes()):
            continue
        for item, after in pairwise([*each.body, ast.Pass()]):
            if not isinstance(item, ast.AnnAssign) or not isinstance(item.target, ast.Name):
                continue
            if item.target.id.startswith("_") or item.target.id == "model_config":
                continue
            has_line = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            line = after.value.value if has_line and isinstance(after.value.value, str) else None
            yield f"{file.relative_to(ROOT)}:{item.lineno} {each.name}.{item.target.id}", item, line


def says_itself(item: ast.AnnAssign) -> bool:
    """It is declared with its text, has the text of its type, or has only one possible value, as the tag of a union."""
    annotation = ast.unparse(item.annotation)
    if annotation in OPTION_GROUPS or "tyro.conf.subcommand" in annotation or "description=" in annotation:
        return True
    if annotation.startswith("ClassVar") or re.fullmatch(r"Literal\['[\w-]+'\]", annotation):
        return True
    if not isinstance(item.value, ast.Call):
        return False
    return name_of(item.value) in ("slider", "choice") or any(each.arg == "description" for each in item.value.keywords)


def words(text: str) -> set[str]:
    return {word.removesuffix("s") for word in re.split(r"[\W_]+", text.lower()) if word} - FILLERS


def restates(item: ast.AnnAssign, line: str) -> bool:
    assert isinstance(item.target, ast.Name)
    return words(line) <= words(item.target.id) | UNITS


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_each_field_of_a_public_type_has_its_own_line(package: Path) -> None:
    files = sorted(package.rglob("*.py"))
    unsaid = [where for file in files for where, item, line in fields(file) if line is None and not says_itself(item)]
    assert unsaid == []


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_line_only_repeats_the_name_of_its_field(package: Path) -> None:
    files = sorted(package.rglob("*.py"))
    assert [where for file in files for where, item, line in fields(file) if line and restates(item, line)] == []


def test_modules_beside_the_packages_too() -> None:
    files = [*(ROOT / "pipeline").glob("*.py"), *(ROOT / "app").glob("*.py")]
    assert [w for file in files for w, item, line in fields(file) if line is None and not says_itself(item)] == []


def test_it_counts_what_there_is() -> None:
    """If no fields were found, none would be missing."""
    found = [where for package in PACKAGES for file in package.rglob("*.py") for where, _, _ in fields(file)]
    assert len(found) > 2000
    bare, named = ast.parse("bare: int\nname: str\n").body
    assert isinstance(bare, ast.AnnAssign)
    assert isinstance(named, ast.AnnAssign)
    assert not says_itself(bare)
    assert restates(named, "The name.")
    assert not restates(named, "Shown to people; unique within a drive.")
