"""
Figure 4: spring force with and without delay
==============================================

The same interface on a soft and on a stiff spring, for contacts that re-attach at once
and after a delay. Without a delay every oscillation decays, however soft the spring.
With one, the soft system sticks and slips for good, strictly periodically.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig4 --check``.
"""

from stickslip.paper import FIGURES

fig4 = FIGURES["fig4"]
data = fig4.compute(quick=True)
figure = fig4.draw(data)
print(fig4.caption)
for claim in fig4.check(data):
    print(claim.title)
    print("   ", claim.verdict)
