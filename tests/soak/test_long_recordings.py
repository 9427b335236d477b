"""A capture of more than 10 GB and a bag of 2 GB: opened and read anywhere in bounded memory. Neither is kept."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
ALLOWED_MB = 150.0
"""Maximum growth due to opening and reading; the files are 70 and 16 times as large."""
ALLOWED_CPU_S_PER_GB, ALLOWED_SEEK_CPU_MS = 12.0, 50.0
"""Twice the CPU time that it takes, which other programs on the machine hardly change."""
ROUNDS = {"pcap": 5_600, "rosbag": 250}  # of 20 sweeps, and of 3


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.skipif(sys.platform != "linux", reason="resident size is in kB on Linux only")
@pytest.mark.parametrize("kind", ROUNDS)
def test_longer_than_memory(kind: str, tmp_path: Path) -> None:
    """In its own process, so that the peak size is that of this work."""
    command = [sys.executable, __file__, kind, str(tmp_path), str(ROUNDS[kind])]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    report = json.loads(done.stdout)
    print(report)
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / f"long_{kind}.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    assert report["GB"] > {"pcap": 10.0, "rosbag": 2.0}[kind]
    assert report["grown_MB"] < ALLOWED_MB
    assert report["open_cpu_s"] < ALLOWED_CPU_S_PER_GB * report["GB"]
    assert report["seek_cpu_ms_median"] < ALLOWED_SEEK_CPU_MS


def _main(kind: str, folder: Path, rounds: int) -> dict[str, float]:
    from time import perf_counter, process_time

    import numpy as np

    from pipeline.sources import open_source
    from tests.pipeline.sources.made import bags, captures
    from tests.pipeline.sources.pcap.test_source import later

    path = folder / ("long.pcap" if kind == "pcap" else "long")
    sweeps = 0
    try:
        if kind == "pcap":
            body = captures.pcap(captures.lidar(20))[24:]
            with path.open("wb") as file:
                file.write(captures.pcap([]))
                for count in range(rounds):
                    file.write(later(body, count * 2_000_000_000))
            sweeps, size = 20 * rounds, path.stat().st_size
        else:
            bags.write_long_bag(path, 3 * rounds)
            sweeps, size = 3 * rounds, sum(file.stat().st_size for file in path.iterdir())
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        begun, spent = perf_counter(), process_time()
        source = open_source(f"{kind}:{path}")
        opened_s, opened_cpu_s = perf_counter() - begun, process_time() - spent
        assert len(source) == sweeps
        seeks, seeks_cpu = [], []
        for index in np.random.default_rng(0).integers(sweeps, size=50):
            begun, spent = perf_counter(), process_time()
            assert source.frame(int(index)).sweep is not None
            seeks.append((perf_counter() - begun) * 1e3)
            seeks_cpu.append((process_time() - spent) * 1e3)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    finally:
        for file in path.iterdir() if path.is_dir() else [path]:
            file.unlink()
    return {
        "GB": round(size / 1e9, 2),
        "sweeps": sweeps,
        "open_s": round(opened_s, 1),
        "open_cpu_s": round(opened_cpu_s, 1),
        "seek_cpu_ms_median": round(float(np.median(seeks_cpu)), 1),
        "seek_ms_median": round(float(np.median(seeks)), 1),
        "seek_ms_max": round(max(seeks), 1),
        "grown_MB": round(grown / 1e3, 1),
    }


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    print(json.dumps(_main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))))
