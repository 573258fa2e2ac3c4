"""The forward model: from a gear, a soil and operating conditions to forces at equilibrium.

`model` is the entry point. A gear (`gears`) gives the contact at a sinkage, `contact` the stresses
and their integrals, `forces` both with the effects (`effects`) applied, `sinkage_search` the
sinkage at which the soil carries the load, and `equilibrium` the forces and readings there.
"""
