"""Feeds damaged inputs to every parser, each in its own process with limited memory and time: ``make fuzz``.

    python -m tests.fuzz.run --seconds 60 [--only session] [--seed 1]
    python -m tests.fuzz.run --inputs 1000000

With ``--seconds``, time is divided equally, so a fast parser gets a thousand times as many inputs as a slow one. With
``--inputs``, inputs are divided, however long that takes. Sessions and ROS bags get a larger share.

An input that raises anything but a refusal, exceeds its time or memory, or ends the process is written to
``build/fuzz/findings``; copied to ``tests/fuzz/findings``, it becomes a test. Inputs that were refused in a new way
form the corpus, ``build/fuzz/corpus``, with which the next run continues.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import os
import random
import resource
import signal
import struct
import sys
import threading
import time
import traceback
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.common.watchdog import waited_s
from tests.fuzz.target import Refused, Target
from tests.fuzz.targets import all_targets

BUILD = Path(__file__).resolve().parents[2] / "build" / "fuzz"
BUDGET_S = 2.0
"""Time limit for one input; the slowest valid one takes a tenth of it."""
BUDGET_BYTES = 1 << 30
"""Limit of address space, in addition to what the process has at its start."""
_OVER_TIME = "takes too long"
_PATIENCE_S = 60.0
"""Maximum time without a new input. Native code that hangs is not ended by a signal."""
_MOST_ENDS = 5
"""Number of times that a target's process may end; it is restarted for the rest of its share."""
_HEAD = struct.Struct("<QI")
"""Header of the memory shared with a target's process: number of inputs so far, length of the current one."""
_LARGEST_INPUT = 1 << 20
_MOST_KEPT = 200
_TOKENS = (
    *(b"nan", b"inf", b"1e999", b"-1", b"0", b"9" * 25, b"null", b"{}", b"[", b":", b"$P", b"!!int ''", b"&a [*a]"),
    *(b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", b"\xe2\x80\xae"),
)


class OverTime(BaseException):
    """Raised if one input took too long."""


def mutated(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """A damaged copy of ``data``. other: another input, from which pieces are inserted."""
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 8))):
        at, length = chance.randrange(len(changed) + 1), chance.choice((1, 2, 4, 8, 64))
        match chance.randrange(8):
            case 0:
                changed[at : at + 1] = bytes([chance.randrange(256)])
            case 1:
                del changed[at : at + length]
            case 2:
                changed[at:at] = chance.randbytes(length)
            case 3:
                changed[at : at + length] = chance.choice(_TOKENS)
            case 4:
                changed[at:at] = chance.choice(_TOKENS)
            case 5:
                changed[at:at] = changed[at : at + 400]
            case 6:
                begin = chance.randrange(len(other) + 1)
                changed[at : at + length] = other[begin : begin + length]
            case _:
                if chance.random() < 0.2:
                    del changed[at:]
                elif at < len(changed):
                    changed[at] ^= 1 << chance.randrange(8)
    return bytes(changed[:_LARGEST_INPUT])


@contextmanager
def within_budget() -> Any:
    """Raises OverTime after ``BUDGET_S`` of processor time, or after ten times that of waiting for anything but a
    processor, since a busy machine is not a finding. Exhausted address space raises MemoryError by itself."""
    thread, began_s = threading.get_native_id(), time.monotonic()
    starved_s = waited_s(thread) or 0.0

    def late(number: int, _: object) -> None:
        if number == signal.SIGALRM:
            starved_now_s = (waited_s(thread) or 0.0) - starved_s
            left_s = 10 * BUDGET_S - (time.monotonic() - began_s - starved_now_s)
            if left_s > 0:
                signal.setitimer(signal.ITIMER_REAL, left_s)
                return
        raise OverTime

    timers = {signal.ITIMER_PROF: (signal.SIGPROF, BUDGET_S), signal.ITIMER_REAL: (signal.SIGALRM, 10 * BUDGET_S)}
    before = {number: signal.signal(number, late) for number, _ in timers.values()}
    for timer, (_, seconds) in timers.items():
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for timer in timers:
            signal.setitimer(timer, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def outcome(target: Target, data: bytes) -> tuple[str, bool]:
    """How it ended, as a word or a position in the code, and whether that is a finding."""
    try:
        with within_budget():
            target.read(data)
    except Refused as error:
        return f"{type(error).__name__}: {str(error)[:60]}", False
    except OverTime:
        return _OVER_TIME, True
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno}", True
    return "read", False


@dataclass(frozen=True)
class Share:
    """The share of a target: a number of inputs, or of seconds."""

    inputs: float = math.inf
    seconds: float = math.inf

    def times(self, part: float) -> Share:
        return Share(self.inputs * part, self.seconds * part)

    def less(self, inputs: int, seconds: float) -> Share:
        return Share(self.inputs - inputs, self.seconds - seconds)

    def is_left(self) -> bool:
        return self.inputs > 0 and self.seconds > 0


def fuzz(name: str, target: Target, share: Share, seed: str, build: Path, shared: Any) -> None:
    """Fuzz one target in its own process, with the log messages of libraries suppressed. shared: memory that holds the
    current input after ``_HEAD``."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    chance = random.Random(seed)
    corpus = build / "corpus" / file_name(name)
    corpus.mkdir(parents=True, exist_ok=True)
    kept = [*target.seeds, *(path.read_bytes() for path in sorted(corpus.iterdir()))]
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + BUDGET_BYTES, size + BUDGET_BYTES))
    seen: set[str] = set()
    findings: dict[str, bytes] = {}
    count, began_s = 0, time.monotonic()
    while share.less(count, time.monotonic() - began_s).is_left():
        data = mutated(chance.choice(kept), chance.choice(kept), chance)
        count += 1
        shared[: _HEAD.size + len(data)] = _HEAD.pack(count, len(data)) + data
        how, is_finding = outcome(target, data)
        if how == _OVER_TIME:  # once may be an import, or the machine
            how, is_finding = outcome(target, data)
        if is_finding:
            findings.setdefault(how, data)
        elif how not in seen and len(kept) < _MOST_KEPT:
            seen.add(how)
            kept.append(data)
            (corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    report(build, name, count, findings)


def file_name(target: str) -> str:
    """Name of a target's folder and report."""
    return target.replace(" ", "_").replace(",", "")


def report(build: Path, name: str, count: int, findings: dict[str, bytes]) -> None:
    """Write new findings beside those of earlier runs."""
    folder = build / "findings" / file_name(name)
    for data in findings.values():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    (build / "reports").mkdir(parents=True, exist_ok=True)
    (build / "reports" / f"{file_name(name)}.json").write_text(
        json.dumps({"target": name, "inputs": count, "findings": sorted(findings)})
    )


def run_one(name: str, target: Target, share: Share, seed: int, build: Path) -> dict[str, Any]:
    """Fuzz a target until its share is used up, in a new process whenever one ended or hung. Returns its figures."""
    context = multiprocessing.get_context("fork")
    done: dict[str, Any] = {"target": name, "inputs": 0, "findings": []}
    file = build / "reports" / f"{file_name(name)}.json"
    for attempt in range(_MOST_ENDS):
        file.unlink(missing_ok=True)
        shared = memoryview(context.RawArray("c", _HEAD.size + _LARGEST_INPUT)).cast("B")
        began_s = time.monotonic()
        process = context.Process(target=fuzz, args=(name, target, share, f"{seed} {name} {attempt}", build, shared))
        process.start()
        before = -1
        while process.is_alive() and before != (before := _HEAD.unpack(shared[: _HEAD.size])[0]):
            process.join(_PATIENCE_S)
        if process.is_alive() or not file.is_file():  # native code that hangs or crashes reports nothing
            process.kill()
            process.join()
            count, length = _HEAD.unpack(shared[: _HEAD.size])
            data = bytes(shared[_HEAD.size : _HEAD.size + length])
            report(build, name, count, {f"the process ended or hung ({process.exitcode})": data})
        told = json.loads(file.read_text())
        done["inputs"] += told["inputs"]
        done["findings"] = sorted({*done["findings"], *told["findings"]})
        share = share.less(told["inputs"], time.monotonic() - began_s)
        if not share.is_left():
            break
    file.write_text(json.dumps(done))
    return done


def run(share: Share, seed: int = 0, only: str = "", build: Path = BUILD) -> list[dict[str, Any]]:
    """Fuzz every target with its part of the share. Returns the figures of each."""
    found: list[dict[str, Any]] = []
    with contextmanager(all_targets)() as known:
        chosen = {name: target for name, target in known.items() if only in name}
        weight = sum(target.weight for target in chosen.values())
        for name, target in chosen.items():
            began_s = time.monotonic()
            found.append(run_one(name, target, share.times(target.weight / weight), seed, build))
            took_s, told = time.monotonic() - began_s, "; ".join(found[-1]["findings"])
            print(f"{found[-1]['inputs']:9,}  {took_s:6.0f} s  {name}  {told}", flush=True)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--inputs", type=int, help="instead of --seconds")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--only", default="")
    typed = parser.parse_args()
    with suppress(KeyboardInterrupt):
        share = Share(seconds=typed.seconds) if typed.inputs is None else Share(inputs=typed.inputs)
        done = run(share, typed.seed, typed.only)
        inputs, findings = sum(each["inputs"] for each in done), sum(len(each["findings"]) for each in done)
        print(f"{inputs:,} inputs, {findings} findings, seed {typed.seed}; see {BUILD}")
        return 1 if findings else 0
    return 130


if __name__ == "__main__":
    sys.exit(main())
