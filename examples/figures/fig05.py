"""
Figure 5: at and after the elastic instability
==============================================

The first slip seen closely: contacts break in an avalanche, inertia delays it, and the
velocity peaks at many times that of the drive. Eq. (12) estimates how far the slider
moves meanwhile.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig5 --check``.
"""

from stickslip.paper import FIGURES

fig5 = FIGURES["fig5"]
data = fig5.compute(quick=True)
figure = fig5.draw(data)
print(fig5.caption)
for claim in fig5.check(data):
    print(claim.title)
    print("   ", claim.verdict)
