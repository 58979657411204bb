"""Every hard case keeps its bounds; what each is about stands in the case itself."""

from __future__ import annotations

import pytest

from mechanism_sim.bench.hard import cases, run


@pytest.mark.parametrize('case', cases(), ids=lambda case: case.name)
def test_hard_case(case):
    (outcome,) = run((case,))
    assert not outcome.failure
    assert outcome.figures
    broken = [f'{f.name} = {f.value:.6g} {f.unit}, bound {f.bound:g}'
              for f in outcome.figures if not f.ok]  # fmt: skip
    assert not broken
