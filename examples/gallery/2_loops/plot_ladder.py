"""
Redundant loops, by name
========================

A ladder of spherical joints has loops whose rows depend on each other. Claim: the count of degrees of freedom follows
the published rule N, 4 N and 6 N for revolute, cylindrical and spherical joints (docs/theory.md (23.4)).
"""

import mbrs as mb

for joint, each in (("revolute", 1), ("cylindrical", 4), ("spherical", 6)):
    for layers in (2, 3):
        system = mb.System(mb.examples.ladder(layers, joint=joint))
        print(f"{joint}, {layers} layers: {system.dof} degrees of freedom")
        assert system.dof == each * layers
picture = mb.modes(mb.examples.ladder(3, joint="revolute")).plot()
