"""Tries mutations of files on every reader: `python -m tests.fuzz.fuzzing --seconds 3600`.

The order of the inputs is that of the seed, so a run can be repeated. What is found is written to the folder `--keep`,
and printed with its number; `--inputs 1 --first N` tries that one again.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.fuzz.corpus import corpus
from tests.fuzz.judging import Judge
from tests.fuzz.mutations import mutated, repaired

SLOW_KINDS = frozenset({"video"})
"""Tried a third as often as the others."""


@dataclass(frozen=True)
class Input:
    """A mutated file.

    Attributes:
        number: in the order of its seed.
        kind, suffix: as of `lying_files.LyingFile`.
        data: its content.
    """

    number: int
    kind: str
    suffix: str
    data: bytes


@dataclass(frozen=True)
class Finding:
    """What is wrong with how a file is read."""

    file: Input
    what: str


def inputs(seed: int, first: int = 0) -> Iterator[Input]:
    """Mutated files without end, always the same of a seed; from the first-th on."""
    files = corpus()
    kinds = [kind for kind in files for _ in range(1 if kind in SLOW_KINDS else 3)]
    number = first
    while True:
        random = Random(seed * 1_000_003 + number)
        kind = random.choice(kinds)
        suffix, data = random.choice(files[kind])
        changed = mutated(data, [other for _, other in files[kind]], random)
        if random.random() < 0.7:
            changed = repaired(changed)
        yield Input(number, kind, suffix, changed)
        number += 1


def fuzz(
    most_inputs: int, most_seconds: float, seed: int = 0, first: int = 0, stops_at: int = 20
) -> tuple[Counter[str], list[Finding]]:
    """Try mutated files.

    Args:
        most_inputs, most_seconds: where to stop.
        seed: of the files.
        first: number of the first one.
        stops_at: so many findings.

    Returns:
        How many files of each kind were tried, and what was found.
    """
    tried: Counter[str] = Counter()
    findings: list[Finding] = []
    ends = time.monotonic() + most_seconds
    with Judge(lowered=True) as judge:
        for file in inputs(seed, first):
            if tried.total() == most_inputs or time.monotonic() > ends or len(findings) >= stops_at:
                break
            tried[file.kind] += 1
            if wrong := judge.judge(file.kind, file.suffix, file.data):
                # Once more, in a new process: what it finds there is of this file, not of those before it.
                with Judge(lowered=True) as other:
                    wrong = other.judge(file.kind, file.suffix, file.data)
                findings += [Finding(file, what) for what in wrong]
    return tried, findings


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--inputs", type=int, default=sys.maxsize)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("test-failures/fuzz"))
    given = parser.parse_args()
    began = time.monotonic()
    tried, findings = fuzz(given.inputs, given.seconds, given.seed, given.first)
    for finding in findings:
        given.keep.mkdir(parents=True, exist_ok=True)
        path = given.keep / f"{given.seed}-{finding.file.number}{finding.file.suffix}"
        path.write_bytes(finding.file.data)
        print(f"{path} ({finding.file.kind}): {finding.what}")
    print(f"{tried.total()} inputs in {time.monotonic() - began:.0f} s, {len(findings)} findings: {dict(tried)}")
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
