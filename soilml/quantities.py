"""Nomenclature: the only place where a quantity is named.

A quantity's `column` is its name in every table that soilml reads or writes; the unit is part of
the column name, so that a file cannot be read in the wrong unit.
"""

from __future__ import annotations

from dataclasses import dataclass

_SUFFIX = {
    "1": "",
    "N m": "_Nm",
    "m/s": "_m_s",
    "m/s^2": "_m_s2",
    "rad/s": "_rad_s",
    "m^2": "_m2",
    "N/m^3": "_N_m3",
    "N/m^(n+1)": "_SI",
    "N/m^(n+2)": "_SI",
    "-": "",
}


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: name, symbol, SI unit, and what it is, with its sign."""

    name: str
    symbol: str
    unit: str
    text: str

    @property
    def column(self) -> str:
        """The quantity's column name in tables: `torque_Nm`, `sinkage_m`, `slip`."""
        return self.name + _SUFFIX.get(self.unit, f"_{self.unit}")


_ALL = (
    Quantity("run", "", "-", "name of the run: rows driven together"),
    Quantity("slip", "s", "1", "slip ratio: driving 1 - v/(r omega), braking r omega/v - 1"),
    Quantity("load", "W", "N", "vertical load on the wheel"),
    Quantity("torque", "T", "N m", "drive torque, positive when it drives forward"),
    Quantity("drawbar_pull", "DP", "N", "net pull of the wheel on its axle, positive forward"),
    Quantity("sinkage", "z", "m", "depth of the lowest point of the rim below the free surface"),
    Quantity("entry_angle", "theta_1", "rad", "where the rim meets the soil, from straight down"),
    Quantity("side_force", "Fy", "N", "sideways force of the soil on the wheel"),
    Quantity("speed", "v", "m/s", "travel speed of the axle"),
    Quantity("pass", "", "-", "1 on virgin soil, 2 in the rut of one wheel, ..."),
    Quantity("slip_angle", "beta", "rad", "angle between the wheel's plane and its travel"),
    Quantity("progress", "p", "-", "share of the campaign that is over, 0 at its first row"),
    Quantity("load_direction", "d", "-", "1 where the load last rose, -1 where it last fell"),
    Quantity(
        "vibration", "Delta a", "m/s^2", "largest amplitude of the hub's acceleration, a stride"
    ),
    Quantity("time", "t", "s", "time since the start of the log"),
    Quantity("status", "", "-", "ok, or why the row has no answer"),
    Quantity("source", "", "-", "where the row comes from"),
    Quantity("wheel_radius", "r", "m", "radius of the wheel that was driven"),
    Quantity("wheel_width", "b", "m", "width of the wheel that was driven"),
    Quantity("grouser_height", "h", "m", "height of the grousers of the wheel that was driven"),
    Quantity("grouser_count", "", "1", "number of grousers of the wheel that was driven"),
    Quantity("cohesion", "c", "Pa", "cohesion of the soil"),
    Quantity("friction_angle", "phi", "rad", "internal friction angle of the soil"),
    Quantity("shear_modulus", "K", "m", "shear deformation modulus of the soil"),
    Quantity("kc", "k_c", "N/m^(n+1)", "cohesive modulus of sinkage (Bekker)"),
    Quantity("kphi", "k_phi", "N/m^(n+2)", "frictional modulus of sinkage (Bekker)"),
    Quantity("n", "n", "1", "exponent of sinkage (Bekker)"),
    Quantity(
        "normal_stiffness", "sigma_1", "Pa", "normal stress of the soil 1 cm deep, linearised"
    ),
    Quantity("a0", "a_0", "1", "angle of maximum stress, share of the entry angle at no slip"),
    Quantity("a1", "a_1", "1", "growth of that share with slip"),
    Quantity("unit_weight", "gamma", "N/m^3", "weight of the soil per volume"),
    Quantity("slope", "alpha", "rad", "slope of the ground along the travel, positive uphill"),
    Quantity("rim_speed", "r omega", "m/s", "speed of the rim of the wheel about its axle"),
    Quantity("wheel_speed", "omega", "rad/s", "rotation of the wheel, positive forward"),
    Quantity("current", "I", "A", "current of the motor, positive when it drives forward"),
    Quantity("roll", "rho", "rad", "roll of the rover, positive where its left side is higher"),
    Quantity(
        "angle", "theta", "rad", "place on the rim, from straight down; rotation of a shear ring"
    ),
    Quantity("normal", "sigma_s", "Pa", "normal stress that a sensor on the rim reads"),
    Quantity("force", "F_s", "N", "force that a sensor on the rim reads"),
    Quantity("belt_travel", "L_t", "m", "way of a track's belt since the start of a pull"),
    Quantity("travel", "L", "m", "way of the robot since the start of a pull"),
    Quantity("tension", "", "N", "tension between a robot and what it pulls"),
    Quantity("front_laser", "l_f", "m", "distance from a laser at the front to the ground"),
    Quantity("rear_laser", "l_r", "m", "distance from a laser at the rear to the ground"),
    Quantity("inclination", "delta", "rad", "inclination of a robot, positive with its tail down"),
    Quantity("sensor", "", "-", "number of a sensor in the row across the rim, 1 or more"),
    Quantity(
        "wheel",
        "",
        "-",
        "which wheel of a rover, by its name in [rover.wheels]; front or rear for climb",
    ),
    Quantity("test", "", "-", "name of the plate or shear test"),
    Quantity("plate_radius", "", "m", "radius of the round plate that was pressed into the soil"),
    Quantity("plate_width", "b", "m", "width of the plate, its smaller dimension"),
    Quantity("plate_length", "", "m", "length of the plate"),
    Quantity("plate_area", "A", "m^2", "area of the round plate"),
    Quantity("pressure", "p", "Pa", "mean pressure under the plate"),
    Quantity("normal_stress", "sigma", "Pa", "normal stress in a shear test"),
    Quantity("shear_displacement", "j", "m", "displacement in a shear test; blank: steady end"),
    Quantity("shear_stress", "tau", "Pa", "shear stress in a shear test"),
    Quantity("inner_radius", "r_i", "m", "inner radius of the shear ring"),
    Quantity("outer_radius", "r_o", "m", "outer radius of the shear ring"),
    Quantity("x", "x", "m", "position on the map, to the east"),
    Quantity("y", "y", "m", "position on the map, to the north"),
    Quantity("heading", "psi", "rad", "direction of travel on the map, from x towards y"),
    Quantity("gear", "", "-", "which gear was driven: NAME of [gears.NAME] in the model file"),
)

#: Every quantity by name.
QUANTITIES: dict[str, Quantity] = {quantity.name: quantity for quantity in _ALL}
#: Every quantity by its column name in tables.
COLUMNS: dict[str, Quantity] = {quantity.column: quantity for quantity in _ALL}
#: What the shear law of the soil needs, in the order of every estimate: c, phi, K.
SHEAR = ("cohesion", "friction_angle", "shear_modulus")
#: Channels that a rover can measure and a model predicts.
CHANNELS = ("torque", "drawbar_pull", "sinkage")
#: Quantiles of the standard normal distribution: 50 % and 90 % of it lie within +- Z_50, +- Z_90.
Z_50, Z_90 = 0.6744897501960817, 1.6448536269514722
#: Remaining fraction of the prior's standard deviation above which a parameter is not identified:
#: the measurement has then removed less than 36 % of the prior's variance.
NOT_IDENTIFIED_ABOVE = 0.8
#: The same above which it is weakly identified: less than 75 % of the variance removed.
WEAKLY_IDENTIFIED_ABOVE = 0.5


def column(name: str) -> str:
    """Column name of the quantity called `name`."""
    return QUANTITIES[name].column
