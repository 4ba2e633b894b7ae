"""
Figure 9: velocity up and down, with ageing
===========================================

Stick-slip begins at one velocity and fades away at a higher one; on the way down it
sets in again, and persists to a much lower velocity than the one at which it began.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig9 --check``.
"""

from stickslip.paper import FIGURES

fig9 = FIGURES["fig9"]
data = fig9.compute(quick=True)
figure = fig9.draw(data)
print(fig9.caption)
for claim in fig9.check(data):
    print(claim.title)
    print("   ", claim.verdict)
