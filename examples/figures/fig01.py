"""
Figure 1: the force on a rigid slider
=====================================

A slider is pushed over the interface at constant speed. From a narrow start all
contacts stretch together and break together: the force rises, overshoots and decreases,
faster than a soft spring can follow. Contacts re-attach at different places, their
stretchings differ more and more, and the force settles at the kinetic friction. Lines
are the master equation, dots a thousand contacts.

The same with all points and contacts, and with the paper's claims checked:
``stickslip paper fig1 --check``.
"""

from stickslip.paper import FIGURES

fig1 = FIGURES["fig1"]
data = fig1.compute(quick=True)
figure = fig1.draw(data)
print(fig1.caption)
for claim in fig1.check(data):
    print(claim.title)
    print("   ", claim.verdict)
