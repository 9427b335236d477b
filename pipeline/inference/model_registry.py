"""Networks by name: the known ones, their download addresses, and the folder where they are stored.

The folder is ``~/.cache/cipv/models`` (``CIPV_HOME`` replaces ``~/.cache/cipv``). A network is chosen by name or path.
Without either, it is the registered default, then the first known one found in the folder or in ``$CIPV_DATA/models``,
then the embedded one, which was trained on simulated vehicles only.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import urllib.error
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel

from pipeline.common.errors import BadInput
from pipeline.common.files.data_dir import data_dir, file_sha256
from pipeline.common.files.own_folder import own_folder, why_impossible
from pipeline.common.files.user_file_errors import given_path, reason_of
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.common.files.whole_files import replace_text
from pipeline.common.progress import Progress, silent
from pipeline.inference.distance_laws import find_law, law_file
from pipeline.inference.known_networks import KNOWN, KnownModel, Task
from pipeline.types import DistanceLaw

EMBEDDED = "embedded"
"""Name of the built-in detector."""
EMBEDDED_FILE = Path(__file__).parents[1] / "vision" / "embedded" / "simulated_vehicles.onnx"
"""Its file."""
_LARGEST_BYTES = 2 << 30
"""Limit of protobuf."""
_CHUNK = 1 << 16
_TIMEOUT_S = 30.0


class ModelError(BadInput):
    """A network that cannot be downloaded, registered or found; one sentence with the remedy."""


@dataclass(frozen=True)
class ModelEntry:
    """One row of ``cipv models``."""

    name: str
    """As in ``--detector NAME``."""
    task: Task
    """What it detects."""
    path: Path | None
    """Its file; None while it is not installed."""
    default: bool
    """Used if no network is named."""
    licence: str | None
    """Licence of the weights; None if unknown."""
    url: str | None
    """Origin; None if unknown."""
    note: str
    """For people."""
    law: DistanceLaw | None = None
    """The distance law measured for it; None: the law for real vehicles is used."""


def store() -> Path:
    """The folder of installed networks; it need not exist. ModelError if it cannot exist."""
    folder = own_folder() / "models"
    impossible = why_impossible(folder)
    if impossible is not None:
        raise ModelError(impossible)
    return folder


def list_models() -> tuple[ModelEntry, ...]:
    """Known networks in order, the embedded one, then registered ones by name."""
    defaults = {task: default_model(task) for task in ("detector", "lanes")}

    def entry(name: str, task: Task, licence: str | None, url: str | None, note: str) -> ModelEntry:
        path = _located(name)
        official = next((known.sha256 for known in KNOWN if known.name == name), None)
        if path is not None and official is not None and file_sha256(path) != official:
            licence, url, note = None, None, f"not the official file of this name: {note}"
        law = find_law(path).law if path is not None and task == "detector" else None
        return ModelEntry(name, task, path, _same(path, defaults[task]), licence, url, note, law)

    known = [entry(each.name, each.task, each.licence, each.url, each.note) for each in KNOWN]
    own = "built in: simulated vehicles only, 0.5 M parameters"
    names = {each.name for each in KNOWN}
    registered = [
        entry(name, row.task, None, None, "registered")
        for name, row in sorted(_read_registry().models.items())
        if name not in names
    ]
    return (*known, entry(EMBEDDED, "detector", None, None, own), *registered)


def find(spec: str) -> Path | None:
    """The file of a network by path or name; None if there is none."""
    path = given_path(spec, ModelError)
    if path.is_file():
        return path
    return _located(spec) if _is_name(spec) else None


def default_model(task: Task) -> Path | None:
    """The network used if none is named; None if none is installed."""
    chosen = _read_registry().defaults.get(task)
    names = [chosen] if chosen else []
    names += [known.name for known in KNOWN if known.task == task]
    names += [EMBEDDED] if task == "detector" else []
    found = (_located(name) for name in names)
    return next((path for path in found if path is not None), None)


def own_file(path: Path) -> Path:
    """A file to register, with ``~`` resolved. ModelError if it does not exist."""
    given = given_path(path, ModelError)
    if not given.is_file():
        raise ModelError(f"no file at {path}")
    return given


def register(path: Path, name: str, task: Task = "detector", default: bool = True) -> Path:
    """Install a file, with the distance law beside it, under ``name``, by default as its task's default. ModelError
    says why it cannot be installed."""
    if not _is_name(name):
        raise ModelError(f"{name!r} is not a valid network name: use letters, digits, '-', '_' and '.'")
    if name == EMBEDDED:
        raise ModelError(f"{EMBEDDED!r} is the built-in detector: use another name")
    path = own_file(path)
    target = store() / f"{name}.onnx"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if not _same(path, target):
            part = target.with_suffix(".part")
            shutil.copyfile(path, part)
            part.replace(target)
            law_file(target).unlink(missing_ok=True)
            if law_file(path).is_file():
                shutil.copyfile(law_file(path), law_file(target))
    except OSError as error:
        raise ModelError(f"{target} cannot be written: {error.strerror or error}") from None
    registry = _read_registry()
    registry.models[name] = _Registered(task=task, sha256=file_sha256(target))
    if default:
        registry.defaults[task] = name
    _write_registry(registry)
    return target


def read_verified(path: Path) -> bytes:
    """A network's file. ModelError if it differs from the installed one: a registered file from its registration, an
    official one from its publication, the embedded one from that of the program. Other files are not checked
    (``used_files`` reports their changes). OSError if it cannot be read."""
    data, expected = read_regular(path, _LARGEST_BYTES), _expected_sha256(path)
    found = hashlib.sha256(data).hexdigest()
    if expected is not None and found != expected:
        raise ModelError(
            f"{path.name} is damaged or was changed: its SHA-256 is {found[:12]}…, not {expected[:12]}…; "
            "pull or register it again"
        )
    return data


def is_checked(path: Path) -> bool:
    """Whether ``read_verified`` knows what the file should contain."""
    return _expected_sha256(path) is not None


def _expected_sha256(path: Path) -> str | None:
    if _same(path, EMBEDDED_FILE):
        return str(json.loads(law_file(EMBEDDED_FILE).read_text(encoding="utf-8"))["network_sha256"])
    # whatever its path: links lead into the store and out of it
    name = next((each.stem for each in store().glob("*.onnx") if each.exists() and each.samefile(path)), None)
    if name is None:
        return None
    registered = _read_registry().models.get(name)
    if registered is not None and registered.sha256:
        return registered.sha256
    return next((known.sha256 for known in KNOWN if known.name == name), None)


def known_model(name: str) -> KnownModel:
    """The official network with this name. ModelError for any other."""
    known = next((model for model in KNOWN if model.name == name), None)
    if known is None:
        raise ModelError(f"no network named {name!r}; known are {', '.join(model.name for model in KNOWN)}")
    return known


def pull(name: str, progress: Progress = silent) -> Path:
    """Download and install a known network, checking size and SHA-256. If a correct file is already installed, it is
    kept. ModelError gives the reason of a failure; no part of a failed download remains."""
    known = known_model(name)
    if known.size is None or known.sha256 is None:
        raise ModelError(f"{name} has no download with a known checksum: {known.remedy}; see {known.url}")
    target = store() / f"{name}.onnx"
    if target.is_file() and file_sha256(target) == known.sha256:
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ModelError(f"{target.parent} cannot be created: {error.strerror or error}") from None
    part = target.with_suffix(".part")
    try:
        _download(known, known.size, part, progress)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
    return target


def _download(known: KnownModel, size: int, part: Path, progress: Progress) -> None:
    digest, done = hashlib.sha256(), 0
    try:
        with urllib.request.urlopen(known.url, timeout=_TIMEOUT_S) as response, part.open("wb") as file:
            while chunk := response.read(_CHUNK):
                done += len(chunk)
                if done > size:
                    break
                file.write(chunk)
                digest.update(chunk)
                progress(done, size)
    except urllib.error.HTTPError as error:
        error.close()
        raise ModelError(
            f"{known.url} answered {error.code} {error.reason}; download the file manually and use {known.register}"
        ) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "reason", None) or error
        raise ModelError(
            f"{known.name} cannot be downloaded ({why}); without a network connection use {known.register}"
        ) from None
    if done != size:
        raise ModelError(f"{known.url} sent {'more than ' if done > size else f'{done} of '}{size} bytes; try again")
    if digest.hexdigest() != known.sha256:
        raise ModelError(
            f"{known.url} is not the official file: its SHA-256 is {digest.hexdigest()}, not {known.sha256}"
        )


def _located(name: str) -> Path | None:
    if name == EMBEDDED:
        return EMBEDDED_FILE
    candidates = (folder / f"{name}.onnx" for folder in (store(), data_dir() / "models"))
    return next((path for path in candidates if path.is_file()), None)


def _is_name(text: str) -> bool:
    return bool(text) and not text.startswith(".") and all(c.isalnum() or c in "-_." for c in text)


def _same(a: Path | None, b: Path | None) -> bool:
    return a is not None and b is not None and a.resolve() == b.resolve()


class _Registered(BaseModel):
    task: Task
    sha256: str = ""


class _Registry(BaseModel):
    """The content of ``registry.json``."""

    defaults: dict[Task, str] = {}
    models: dict[str, _Registered] = {}


def _read_registry() -> _Registry:
    path = store() / "registry.json"
    try:
        registry = _Registry.model_validate_json(read_regular(path, LARGEST_TEXT_BYTES))
    except FileNotFoundError:
        return _Registry()
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {reason_of(error)}") from None
    except (ValueError, RecursionError):
        registry = None
    if registry is None or not all(map(_is_name, (*registry.models, *registry.defaults.values()))):
        raise ModelError(f"{path} is damaged; delete it and register your networks again")
    return registry


def _write_registry(registry: _Registry) -> None:
    text = json.dumps(registry.model_dump(), indent=1, sort_keys=True)
    replace_text(store() / "registry.json", text + "\n")
