"""Damaged files by the thousand, real ones too where they are here, end in one of two ways."""

from pathlib import Path

import pytest

from benchmarks.studies.fuzz_reader import corpus, run

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(n, marks=pytest.mark.study) for n in (1, 2, 3))]
)
def test_damaged_files_end_in_a_measurement_or_in_the_one_error(tmp_path: Path, seed: int) -> None:
    count = 2_000 if seed == 0 else 6_000
    ends = run(count, seed, corpus(SHARED), tmp_path)
    # both ends are met often, so neither is all that the damage leaves
    assert ends["measurement"] > count // 24 and ends["refusal"] > count // 3
