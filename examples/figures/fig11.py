"""
Figure 11: effective stiffness with ageing
==========================================

The steepest decrease of the force on newborn contacts as they are pulled, against the
velocity: it equals the stiffness of the spring where stick-slip begins, not where it
ends.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig11 --check``.
"""

from stickslip.paper import FIGURES

fig11 = FIGURES["fig11"]
data = fig11.compute(quick=True)
figure = fig11.draw(data)
print(fig11.caption)
for claim in fig11.check(data):
    print(claim.title)
    print("   ", claim.verdict)
