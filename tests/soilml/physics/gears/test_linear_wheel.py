"""The closed form against quadrature, and where its load has a peak."""

import numpy as np
import pytest
from scipy.integrate import quad

from soilml import LinearWheel, Model, Operating, Soil
from soilml.physics.forces import load_at_sinkage
from soilml.physics.load_case import LoadCase
from soilml.row_status import Status

SOIL = Soil(
    cohesion=900.0, friction_angle=0.55, shear_modulus=0.012, kc=990.0, kphi=1.5e6, n=1.1,
    a0=0.4, a1=0.2,
)  # fmt: skip
R, B = 0.15, 0.12


@pytest.mark.parametrize("slip", [0.05, 0.3, 0.8])
@pytest.mark.parametrize("load", [8.0, 60.0, 400.0])
def test_forces_are_the_quadrature_of_stresses_that_are_linear_in_the_angle(slip, load):
    force = Model(LinearWheel(radius=R, width=B))(SOIL, Operating(slip=slip, load=load))
    t1 = float(force.entry_angle)
    tm = (SOIL.a0 + SOIL.a1 * slip) * t1
    sm = (SOIL.kc / B + SOIL.kphi) * (R * (np.cos(tm) - np.cos(t1))) ** SOIL.n
    j0 = R * (t1 - (1 - slip) * np.sin(t1))
    jm = R * (t1 - tm - (1 - slip) * (np.sin(t1) - np.sin(tm)))
    t0 = SOIL.cohesion * (1 - np.exp(-j0 / SOIL.shear_modulus))
    taum = SOIL.cohesion + sm * np.tan(SOIL.friction_angle)
    taum *= 1 - np.exp(-jm / SOIL.shear_modulus)

    def sigma(x):
        return np.interp(x, [0, tm, t1], [0, sm, 0])

    def tau(x):
        return np.interp(x, [0, tm, t1], [t0, taum, 0])

    def total(f):
        return R * B * quad(f, 0, t1, points=[tm])[0]

    expected = total(lambda x: sigma(x) * np.cos(x) + tau(x) * np.sin(x))
    assert expected == pytest.approx(load, rel=1e-9)
    pull = total(lambda x: tau(x) * np.cos(x) - sigma(x) * np.sin(x))
    assert force.drawbar_pull == pytest.approx(pull, rel=1e-9)
    assert force.torque == pytest.approx(R * total(tau), rel=1e-9)


def test_an_equilibrium_just_below_the_peak_of_the_load_states_the_load_that_it_carries():
    """The scan finds no crossing between its points there, and the root search about the peak does.

    The rows are from a search through the box of braking wheels.
    """
    soil = Soil(
        cohesion=np.asarray([2244.537938386202, 2269.5698998868465, 1718.0201187729836]),
        friction_angle=np.asarray([0.8290915854051261, 0.8056745073053848, 0.5599285210253216]),
        shear_modulus=np.asarray([0.002522120835098956, 0.002424895402394172, 0.00891222683245248]),
        n=np.asarray([0.6438984613865615, 1.4523356430232526, 1.3096161931753159]),
        kc=0.0,
        kphi=np.asarray([221060.46883559917, 121741.84542676377, 2293465.7104387907]),
        a0=np.asarray([0.4828799720853567, 0.5303402152843772, 0.5975741235539317]),
        a1=np.asarray([0.2753545314073563, 0.027620629593729972, 0.13078034548088907]),
    )
    wheel = LinearWheel(
        radius=np.asarray([0.04199350638602185, 0.30152896774138055, 0.20505270160375524]),
        width=np.asarray([0.1911826593424846, 0.35651888483894295, 0.029130413148363316]),
        braking="slip-sign",
    )
    slip = np.asarray([-0.6514795457012953, -0.4913247798569501, -0.9048998336773367])
    load = np.asarray([100.23343566192801, 241.7760564670331, 435.97071911189147])
    force = Model(wheel)(soil, Operating(slip=slip, load=load))
    assert (force.status == Status.OK).all()
    np.testing.assert_allclose(force.load, load, rtol=1e-8)
    case = LoadCase(wheel, soil, Operating(slip=slip, load=load), ())
    np.testing.assert_allclose(load_at_sinkage(case, force.sinkage), load, rtol=1e-8)
