"""
Figure 2: elastic instability
=============================

A spring holds the slider. Where the friction force decreases more steeply than the
spring is stiff, there is no equilibrium nearby: the slider jumps as soon as the two
slopes are equal.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig2 --check``.
"""

from stickslip.paper import FIGURES

fig2 = FIGURES["fig2"]
data = fig2.compute(quick=True)
figure = fig2.draw(data)
print(fig2.caption)
for claim in fig2.check(data):
    print(claim.title)
    print("   ", claim.verdict)
