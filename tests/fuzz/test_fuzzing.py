"""A few thousand mutated files on every reader; an hour of them: `python -m tests.fuzz.fuzzing`."""

from __future__ import annotations

import pytest

from tests.fuzz.corpus import corpus
from tests.fuzz.fuzzing import fuzz
from tests.fuzz.judging import Judge
from tests.fuzz.readers import READERS

INPUTS = 8000
MOST_SECONDS = 60.0
"""On a busy machine fewer are tried."""


@pytest.mark.slow
def test_every_sound_file_of_the_corpus_is_read_by_a_reader_that_can_be_judged() -> None:
    with Judge(lowered=True) as judge:
        for kind, files in corpus().items():
            assert kind in READERS
            for suffix, data in files:
                assert judge.judge(kind, suffix, data) == [], (kind, suffix, data[:40])


@pytest.mark.slow
def test_mutated_files_are_refused_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    tried, findings = fuzz(INPUTS, MOST_SECONDS)
    with capsys.disabled():
        print(f"\n{tried.total()} mutated files: {dict(tried)}")
    assert [(finding.file.number, finding.file.kind, finding.what) for finding in findings] == []
    assert set(tried) == set(READERS) - {"harmful", "deadly"}
