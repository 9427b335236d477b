"""What is installed to run the product is pinned with hashes, apart from what it is developed with, and listed."""

from __future__ import annotations

import json
from importlib.metadata import distributions
from pathlib import Path

from tests.supply.sbom import DEVELOPMENT, RUNTIME, bundled, pins, write

TOOLS = {"pytest", "mypy", "ruff", "hypothesis", "playwright", "import-linter", "pytest-xdist", "httpx"}


def test_the_runtime_lock_is_a_part_of_the_other_without_its_tools():
    runtime, development = set(pins(RUNTIME)), set(pins(DEVELOPMENT))
    assert {(pin.name, pin.version) for pin in runtime} <= {(pin.name, pin.version) for pin in development}
    assert not TOOLS & {pin.name for pin in runtime}
    assert {"numpy", "onnxruntime", "fastapi", "viser"} <= {pin.name for pin in runtime}


def test_every_package_of_the_runtime_lock_has_a_hash():
    entries = RUNTIME.read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    assert [entry for entry in entries if "==" in entry and "--hash=sha256:" not in entry] == []


def test_everything_is_accounted_for_with_what_the_wheels_bundle(tmp_path: Path):
    write(tmp_path)
    bom = json.loads((tmp_path / "sbom.json").read_text(encoding="utf-8"))
    parts = {each["name"]: each for each in bom["components"]}
    assert (bom["bomFormat"], bom["specVersion"]) == ("CycloneDX", "1.6")
    assert [name for name, each in parts.items() if "licenses" not in each] == [], "not installed here"
    assert any("x264" in inside["name"] for inside in parts["av"]["components"])
    assert len((tmp_path / "licences.md").read_text(encoding="utf-8").splitlines()) == len(parts) + 2


def test_no_wheel_bundles_an_openssl_without_support():
    """OpenSSL 1.1.1 has had no security fixes since September 2023. Optional and development packages count too."""
    found = {
        (package.name, part["name"]): part.get("version", "not stated")
        for package in distributions()
        for part in bundled(package)
        if part["name"] in ("libssl", "libcrypto")
    }
    assert ("psycopg-binary", "libcrypto") in found, "it is found where it is"
    assert {place: version for place, version in found.items() if version[:1] in "012"} == {}
