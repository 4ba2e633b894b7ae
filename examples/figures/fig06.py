"""
Figure 6: the critical delay
============================

From a narrow start, how long must broken contacts stay detached for stick-slip to
persist? It depends on the mass as A1 + A2 M^(1/3); and since only M v^2 matters, the
dependence on velocity is the same curve.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig6 --check``.
"""

from stickslip.paper import FIGURES

fig6 = FIGURES["fig6"]
data = fig6.compute(quick=True)
figure = fig6.draw(data)
print(fig6.caption)
for claim in fig6.check(data):
    print(claim.title)
    print("   ", claim.verdict)
