"""What the product is made of: ``python -m tests.supply.sbom build`` writes ``sbom.json`` (CycloneDX 1.6) and
``licences.md`` of the packages of ``requirements-runtime.lock`` as they are installed here, with the native libraries
that their wheels bundle, which no package index lists."""

from __future__ import annotations

import json
import re
import sys
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from packaging.markers import Marker

ROOT = Path(__file__).resolve().parents[2]
RUNTIME, DEVELOPMENT = ROOT / "requirements-runtime.lock", ROOT / "requirements.lock"
_PINNED = re.compile(r"^([a-z0-9][a-z0-9._-]*)==([^ ;\\]+)(?:\s*;\s*([^\\]+))?")
_BUNDLED = re.compile(r"(?:^|/)(lib[^/]+?|[^/]+?)(?:-[0-9a-f]{8,})?\.(?:so(?:\.[\d.]+)?|dylib|dll)$")
_LIBRARY_FOLDERS = (".libs/", ".dylibs/")
_SAYS_ITS_VERSION = {
    b"OpenSSL ": re.compile(rb"OpenSSL (\d+\.\d+\.\d+[a-z]*) +\d+ "),
    b"x264 - core ": re.compile(rb"x264 - core (\d+)"),
}
"""Texts by which a library is recognised."""


@dataclass(frozen=True)
class Pin:
    """One line of a lock."""

    name: str
    version: str
    marker: str


def pins(lock: Path) -> Iterator[Pin]:
    """The packages in a lock file."""
    for line in lock.read_text(encoding="utf-8").splitlines():
        found = _PINNED.match(line)
        if found is not None:
            yield Pin(found[1], found[2], (found[3] or "").strip())


def components() -> list[dict[str, Any]]:
    """CycloneDX components: each package of the runtime lock that belongs to this machine, with what it bundles."""
    installed = {_plain(each.name): each for each in distributions()}
    wanted = [pin for pin in pins(RUNTIME) if not pin.marker or Marker(pin.marker).evaluate()]
    return [_component(pin, installed.get(_plain(pin.name))) for pin in wanted]


def bundled(package: Distribution) -> list[dict[str, str]]:
    """The native libraries that a wheel brings along, with the version where a file says it."""
    found: dict[str, dict[str, str]] = {}
    for file in package.files or ():
        text = str(file)
        match = _BUNDLED.search(text)
        if match is not None and any(folder in text for folder in _LIBRARY_FOLDERS):
            found[match[1]] = {"type": "library", "name": match[1]} | _version_of(Path(str(file.locate())))
    return [found[name] for name in sorted(found)]


def licence_of(package: Distribution) -> str:
    """The licence stated by the package; ``not stated`` without one."""
    about = package.metadata
    classifiers = about.get_all("Classifier") or ()
    classified = [text.rpartition(" :: ")[2] for text in classifiers if text.startswith("License")]
    stated = about.get("License-Expression") or "; ".join(classified) or (about.get("License") or "").strip()
    return stated.splitlines()[0][:100] if stated else "not stated"


def _version_of(file: Path) -> dict[str, str]:
    name = file.name
    if not any(part in name for part in ("ssl", "crypto", "x264", "x265")) or not file.is_file():
        return {}
    data = file.read_bytes()
    for pattern in _SAYS_ITS_VERSION.values():
        said = pattern.search(data)
        if said is not None:
            return {"version": said[1].decode()}
    return {}


def _component(pin: Pin, package: Distribution | None) -> dict[str, Any]:
    component: dict[str, Any] = {
        "type": "library",
        "bom-ref": f"pkg:pypi/{pin.name}@{pin.version}",
        "purl": f"pkg:pypi/{pin.name}@{pin.version}",
        "name": pin.name,
        "version": pin.version,
    }
    if package is not None:
        component["licenses"] = [{"license": {"name": licence_of(package)}}]
        inside = bundled(package)
        if inside:
            component["components"] = inside
    return component


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def write(folder: Path) -> None:
    """Write both files."""
    found = components()
    bom = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, RUNTIME.read_text(encoding='utf-8'))}",
        "version": 1,
        "metadata": {"component": {"type": "application", "name": "cipv-studio", "version": "0.1.0"}},
        "components": found,
    }
    (folder / "sbom.json").write_text(json.dumps(bom, indent=1) + "\n", encoding="utf-8")
    rows = ["| package | version | licence | bundles |", "|---|---|---|---|"]
    for each in found:
        inside = ", ".join(" ".join(filter(None, (it["name"], it.get("version")))) for it in each.get("components", ()))
        licence = each["licenses"][0]["license"]["name"] if "licenses" in each else "not installed here"
        rows.append(f"| {each['name']} | {each['version']} | {licence} | {inside} |")
    (folder / "licences.md").write_text("\n".join(rows) + "\n", encoding="utf-8")
    print(f"{len(found)} packages: {folder / 'sbom.json'}, {folder / 'licences.md'}")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
