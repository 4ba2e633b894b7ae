"""The studies as tests, for those who would rather ask pytest."""

import pytest

from verification import STUDIES


@pytest.mark.parametrize("name", STUDIES)
def test_study_comes_out_as_settled(name: str) -> None:
    findings = STUDIES[name].run()
    assert findings
    assert all(claim.ok for claim in findings), "\n".join(str(claim) for claim in findings if not claim.ok)
