"""
Figure 7: velocity up and down
==============================

Stick-slip begins at one velocity on the way up and ends at a lower one on the way down:
between them the rig is bistable. With delays of different lengths it stops again at
high velocity.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig7 --check``.
"""

from stickslip.paper import FIGURES

fig7 = FIGURES["fig7"]
data = fig7.compute(quick=True)
figure = fig7.draw(data)
print(fig7.caption)
for claim in fig7.check(data):
    print(claim.title)
    print("   ", claim.verdict)
