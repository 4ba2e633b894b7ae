"""
Figure 10: critical velocities and the rate of ageing
=====================================================

Both velocities grow as the square of the rate of ageing. Where stick-slip begins is
also known without a run, from the linear stability of smooth sliding.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig10 --check``.
"""

from stickslip.paper import FIGURES

fig10 = FIGURES["fig10"]
data = fig10.compute(quick=True)
figure = fig10.draw(data)
print(fig10.caption)
for claim in fig10.check(data):
    print(claim.title)
    print("   ", claim.verdict)
