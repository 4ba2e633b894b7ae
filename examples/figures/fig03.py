"""
Figure 3: the critical stiffness
================================

How stiff must the spring be to forbid that jump? The steepest fall of the force says it, Eq. (8). It falls as the
thresholds, or the contacts at the start, spread. The paper prints 3.59 for its case; its own Eqs. (1)-(4) give 2.989.

The same with all points and contacts, and with the paper's claims checked: ``stickslip paper fig3 --check``.
"""

from stickslip.paper import FIGURES

fig3 = FIGURES["fig3"]
data = fig3.compute(quick=True)
figure = fig3.draw(data)
for claim in fig3.check(data):
    print(claim.title)
    print("   ", claim.verdict)
