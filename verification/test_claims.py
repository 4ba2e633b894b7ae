"""The paper's claims, figure by figure, with all points and contacts.

"Not reproduced" is a verdict like any other: it passes when the exact value that is stated instead is met.
"""

import pytest

from stickslip.paper import FIGURES


@pytest.mark.parametrize("name", FIGURES)
def test_claims_come_out_as_settled(name):
    figure = FIGURES[name]
    claims = figure.check(figure.compute())
    assert claims
    for claim in claims:
        print(claim)
    assert all(claim.ok for claim in claims), [str(claim) for claim in claims if not claim.ok]
