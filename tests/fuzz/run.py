"""Damaged inputs for every parser, each parser in a process of its own with little memory and time: ``make fuzz``.

    python -m tests.fuzz.run --seconds 60 [--only session] [--seed 1]

What raised something else than a refusal, took more than its time or memory, or ended the process is written to
``build/fuzz/findings``; copy it to ``tests/fuzz/findings`` and it becomes a test. Inputs that were refused in a way not
seen before are the corpus, ``build/fuzz/corpus``, from which the next run goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import random
import resource
import signal
import sys
import time
import traceback
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.fuzz.targets import Refused, Target, all_targets

BUILD = Path(__file__).resolve().parents[2] / "build" / "fuzz"
BUDGET_S = 2.0
"""For one input; the slowest good one takes a tenth."""
BUDGET_BYTES = 1 << 30
"""Address space beyond what the process has when it begins."""
_PATIENCE_S = 60.0
_LARGEST_INPUT = 1 << 20
_MOST_KEPT = 200
_TOKENS = (
    *(b"nan", b"inf", b"1e999", b"-1", b"0", b"9" * 25, b"null", b"{}", b"[", b":", b"$P", b"!!int ''", b"&a [*a]"),
    *(b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", b"\xe2\x80\xae"),
)


class OverTime(BaseException):
    """One input took longer than it may."""


def mutated(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """A damaged copy; ``other``: what pieces are taken from."""
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
    """OverTime after ``BUDGET_S`` of computing, or ten times that of waiting: a busy machine is no finding. An address
    space that is full raises MemoryError by itself."""

    def late(*_: object) -> None:
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
    """How it ended, in a word or a place of the code, and whether that is a finding."""
    try:
        with within_budget():
            target.read(data)
    except Refused as error:
        return f"{type(error).__name__}: {str(error)[:60]}", False
    except OverTime:
        return f"more than {BUDGET_S:g} s", True
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno}", True
    return "read", False


def fuzz(name: str, target: Target, seconds: float, seed: int, build: Path, said: Any) -> None:
    """One target, in a process of its own, whose libraries need not tell what they think of the inputs. said: shared
    array that the input under way is in, behind its length."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    chance = random.Random(f"{seed} {name}")
    corpus = build / "corpus" / name.replace(" ", "_").replace(",", "")
    corpus.mkdir(parents=True, exist_ok=True)
    kept = [*target.seeds, *(path.read_bytes() for path in sorted(corpus.iterdir()))]
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + BUDGET_BYTES, size + BUDGET_BYTES))
    seen: set[str] = set()
    findings: dict[str, bytes] = {}
    count, ends_s = 0, time.monotonic() + seconds
    while time.monotonic() < ends_s:
        data = mutated(chance.choice(kept), chance.choice(kept), chance)
        said[: len(data) + 4] = len(data).to_bytes(4, "little") + data
        how, is_finding = outcome(target, data)
        count += 1
        if is_finding:
            findings.setdefault(how, data)
        elif how not in seen and len(kept) < _MOST_KEPT:
            seen.add(how)
            kept.append(data)
            (corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    report(build, name, count, findings)


def report(build: Path, name: str, count: int, findings: dict[str, bytes]) -> None:
    folder = build / "findings" / name.replace(" ", "_").replace(",", "")
    for data in findings.values():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
    (build / "reports").mkdir(parents=True, exist_ok=True)
    (build / "reports" / f"{name.replace(' ', '_')}.json").write_text(
        json.dumps({"target": name, "inputs": count, "findings": sorted(findings)})
    )


def run(seconds: float, seed: int = 0, only: str = "", build: Path = BUILD) -> list[dict[str, Any]]:
    """Fuzz every target for its share of the time. What each did."""
    found: list[dict[str, Any]] = []
    context = multiprocessing.get_context("fork")
    with contextmanager(all_targets)() as known:
        chosen = {name: target for name, target in known.items() if only in name}
        for name, target in chosen.items():
            file = build / "reports" / f"{name.replace(' ', '_')}.json"
            file.unlink(missing_ok=True)
            said = context.RawArray("c", _LARGEST_INPUT + 4)
            share = seconds / len(chosen)
            process = context.Process(target=fuzz, args=(name, target, share, seed, build, memoryview(said).cast("B")))
            process.start()
            process.join(share + _PATIENCE_S)
            if process.is_alive() or not file.is_file():  # native code that hangs or crashes tells nobody
                process.kill()
                process.join()
                raw = bytes(memoryview(said).cast("B"))
                data = raw[4 : 4 + int.from_bytes(raw[:4], "little")]
                report(build, name, 0, {f"the process ended or hung ({process.exitcode})": data})
            found.append(json.loads(file.read_text()))
            print(f"{found[-1]['inputs']:9,}  {name}  {'; '.join(found[-1]['findings'])}", flush=True)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--only", default="")
    typed = parser.parse_args()
    with suppress(KeyboardInterrupt):
        done = run(typed.seconds, typed.seed, typed.only)
        inputs, findings = sum(each["inputs"] for each in done), sum(len(each["findings"]) for each in done)
        print(f"{inputs:,} inputs, {findings} findings, seed {typed.seed}; see {BUILD}")
        return 1 if findings else 0
    return 130


if __name__ == "__main__":
    sys.exit(main())
