"""Numbers of a design of wheels of any size, and constants of the family."""

from __future__ import annotations

from soilml.numerics.prior import Prior

#: Columns of a design: slip, radius (m), width (m), load (N), exponent n, bearing modulus
#: (N/m^(n+2)), largest cohesion (Pa) and largest shear modulus (m) of the prior.
SLIP, RADIUS, WIDTH, LOAD, EXPONENT, BEARING, COHESION_MAX, SHEAR_MODULUS_MAX = range(8)

#: Priors of cohesion and shear modulus as shares of their largest values. Below a sixth of it,
#: torque hardly depends on the shear modulus.
COHESION_SHARE, SHEAR_MODULUS_SHARE = Prior(0.0, 1.0), Prior(1.0 / 6.0, 1.0)

#: Two nuisance parameters are deviations of the bearing curve from its context inputs: of the
#: logarithm of pressure at the reference depth, and of the exponent n. A coordinate of 1 is a
#: deviation by these.
BEARING_RANGE, EXPONENT_RANGE = 1.0, 0.25
#: Depth over wheel radius at which the two deviations are independent: a typical sinkage.
REFERENCE_DEPTH = 0.05
#: Largest `bearing_std`: the range is `NORMAL_TRUNCATION` = 2.5 of these standard deviations.
MOST_BEARING_STD = 0.4
#: Stands for a standard deviation of zero, of which the logarithm is taken (of the coordinate).
LEAST_NORMAL_STD = 1e-3
