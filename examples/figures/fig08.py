"""
Figure 8: stick-slip and the rate of ageing
===========================================

Newborn contacts have no strength and grow stronger with age. If they age too slowly, or
too quickly, the slider slides smoothly; the upper limit depends on how it was started.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig8 --check``.
"""

from stickslip.paper import FIGURES

fig8 = FIGURES["fig8"]
data = fig8.compute(quick=True)
figure = fig8.draw(data)
print(fig8.caption)
for claim in fig8.check(data):
    print(claim.title)
    print("   ", claim.verdict)
