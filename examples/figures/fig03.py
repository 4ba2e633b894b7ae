"""
Figure 3: the critical stiffness
================================

How stiff must the spring be to prevent that jump? As stiff as the steepest decrease of
the force, Eq. (8). It is lower for wider distributions of the thresholds and of the
initial forces. The paper prints 3.59 for its case; its own Eqs. (1)-(4) give 2.989.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig3 --check``.
"""

from stickslip.paper import FIGURES

fig3 = FIGURES["fig3"]
data = fig3.compute(quick=True)
figure = fig3.draw(data)
print(fig3.caption)
for claim in fig3.check(data):
    print(claim.title)
    print("   ", claim.verdict)
