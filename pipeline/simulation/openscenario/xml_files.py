"""Reads XML files of unknown origin: no document type, so no entities to expand, and limits on size and depth."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from xml.parsers import expat

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, check_allowed, read_regular

_DEEPEST = 60
"""Nested elements; OpenSCENARIO files have about twenty."""
_MOST_ELEMENTS = 300_000
"""Elements of one file: scenarios have hundreds, the road network of a town a hundred thousand."""
_LONGEST_SHOWN = 60


class OpenScenarioError(BadInput):
    """An OpenSCENARIO or OpenDRIVE file that cannot be simulated. The text is one sentence: what in which file, in
    which line."""


@dataclass
class XmlElement:
    """An element of a file that was read."""

    file: str
    """Name of the file, for messages."""
    tag: str
    """Its name."""
    line: int
    """Where it starts, from 1."""
    attributes: dict[str, str]
    """As written."""
    children: list[XmlElement] = field(default_factory=list)
    """In the order of the file."""

    def refusal(self, text: str) -> OpenScenarioError:
        """The error for something wrong with this element."""
        return OpenScenarioError(f"{self.file}, line {self.line}: {text}")

    def find(self, *tags: str) -> XmlElement | None:
        """The first element on this path of tags; None if there is none."""
        here: XmlElement | None = self
        for tag in tags:
            here = next((child for child in here.children if child.tag == tag), None) if here is not None else None
        return here

    def one(self, *tags: str) -> XmlElement:
        """The same, but required."""
        here = self
        for tag in tags:
            found = here.find(tag)
            if found is None:
                raise here.refusal(f"{here.tag} has no {tag}")
            here = found
        return here

    def all(self, tag: str) -> list[XmlElement]:
        """Every child of this name."""
        return [child for child in self.children if child.tag == tag]

    def only(self) -> XmlElement:
        """The single child of an element that stands for one choice."""
        if len(self.children) != 1:
            raise self.refusal(f"{self.tag} has {len(self.children)} elements; expected one")
        return self.children[0]

    def below(self) -> Iterator[XmlElement]:
        """It and everything in it."""
        waiting = [self]
        while waiting:
            here = waiting.pop()
            yield here
            waiting += reversed(here.children)


def shown(text: str) -> str:
    """A name or value from a file as quoted in a message: on one line and not too long."""
    plain = "".join(character if character.isprintable() else " " for character in text)
    return f"{plain[:_LONGEST_SHOWN]}…" if len(plain) > _LONGEST_SHOWN else plain


def named_path(folder: Path, name: str) -> Path:
    """A file or folder that a file in ``folder`` names: there, or else beside that file, if both were copied."""
    there = folder / name.replace("\\", "/")
    try:
        if there.exists():
            return there
        beside = folder / there.name
        for each in (beside, beside.with_name(f"{beside.name}.xodr")):
            if there.name and each.is_file():
                return each
    except (OSError, ValueError):  # a name that no file can have; reading it says so
        pass
    return there


def catalog_paths(folder: Path, name: str) -> list[Path]:
    """The files of a folder with catalogs that a file in ``folder`` names. If there is no such folder, those beside
    that file whose names say that they are catalogs. OSError or ValueError if the folder cannot be listed."""
    there = folder / name.replace("\\", "/")
    check_allowed(there)
    if not there.is_dir():
        beside = sorted(path for path in folder.glob("*.xosc") if "catalog" in path.name.lower())
        if beside:
            return beside
    return sorted(there / each for each in os.listdir(there) if each.lower().endswith(".xosc"))


def read_xml(path: Path, root: str) -> XmlElement:
    """The root element of a file, which must be called ``root``. OpenScenarioError if the file cannot be read, is not
    well-formed, or has a document type: entities could expand to gigabytes or name other files."""
    try:
        data = read_regular(path, LARGEST_TEXT_BYTES)
    except (OSError, ValueError) as error:
        raise OpenScenarioError(f"{shown(path.name)}: cannot be read: {reason_of(error)}") from None
    found = _parsed(data, path.name)
    if found.tag != root:
        raise OpenScenarioError(f"{path.name}: not {root}: its outermost element is {shown(found.tag)}")
    return found


def _parsed(data: bytes, file: str) -> XmlElement:
    parser = expat.ParserCreate()
    open_ones: list[XmlElement] = []
    roots: list[XmlElement] = []
    count = 0

    def refuse_type(*_: object) -> None:
        raise OpenScenarioError(f"{file}, line {parser.CurrentLineNumber}: a document type is not allowed here")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        element = XmlElement(file, tag, parser.CurrentLineNumber, attributes)
        if count > _MOST_ELEMENTS or len(open_ones) >= _DEEPEST:
            raise element.refusal(f"more than {_MOST_ELEMENTS} elements, or more than {_DEEPEST} inside one another")
        (open_ones[-1].children if open_ones else roots).append(element)
        open_ones.append(element)

    parser.StartDoctypeDeclHandler = refuse_type
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_ones.pop()
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise OpenScenarioError(
            f"{file}, line {error.lineno}: not XML: {expat.errors.messages.get(error.code, 'damaged')}"
        ) from None
    except (LookupError, ValueError):  # an encoding that Python does not know
        raise OpenScenarioError(f"{file}: not XML: unknown encoding") from None
    return roots[0]


def number_in(text: str, at: XmlElement, name: str) -> float:
    """A finite number below 10⁹, the largest that any length, speed or time here can sensibly have."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value) or abs(value) > 1e9:
        raise at.refusal(f"{at.tag} {name}={shown(text)!r} is not a number in range")
    return value
