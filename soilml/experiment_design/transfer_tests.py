"""Which test under one gravity tells most of the pull under another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.experiment_design.design import LOADS, candidate_grid
from soilml.experiment_design.expected_variance import expected_variance, predicted_readings
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.fitting.predictions import forces_of_one_gear
from soilml.numerics.quantiles import quantile_band
from soilml.parameters import located
from soilml.physics.operating_point import Operating
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import column
from soilml.remarks import Remark

#: Slips of a test, and the one of the pull that is asked for.
SLIPS, TARGET_SLIP = (0.1, 0.2, 0.3, 0.45, 0.6), 0.3
LAW_DRAWS = 40  # Draws of the law for each sample of the soil
MOST_FAILURE = 0.05  # Largest share of soils and laws that may not carry the wheel there


@dataclass(frozen=True)
class TransferTest:
    """Rows at all slips under a load (N) with a wheel of a radius (m), and what they leave."""

    load: float
    radius: float
    pull_std: float  # Expected standard deviation of the pull there by the model, N
    # Expected root mean square error of the measured pull times the ratio of the loads, N
    scaled_error: float
    speed_ratio: float  # Speed of the test over that there at equal Froude number v^2 / (g r)


@dataclass(frozen=True)
class TransferAdvice:
    """Tests rated by what they tell of a wheel's pull under another gravity."""

    change: GravityChange
    load: float  # of the pull that is asked for, N
    slip: float
    tests: tuple[TransferTest, ...]  # that are carried
    same_load: TransferTest | None  # with the case's own radius; None where it is not carried
    same_mass: TransferTest | None
    pull: float  # mean before any test, N
    known_std: float  # standard deviation before any test, N
    least_std: float  # with the soil known and the law not, N: no test leaves less
    least_width: float  # mean width of the 90 % band likewise, N
    excluded: int  # tests that a twentieth of the soils or more does not carry

    @property
    def best(self) -> TransferTest:
        """The test that leaves the least standard deviation by the model."""
        return min(self.tests, key=lambda test: test.pull_std)

    @property
    def best_scaled(self) -> TransferTest:
        """The test with the least expected error where no model is used."""
        return min(self.tests, key=lambda test: test.scaled_error)

    def remarks(self) -> Iterator[Remark]:
        """What the tests leave, what none can tell, and where the model does not hold."""
        text = (
            f"pull under {self.load:.4g} N and {self.change.target:.3g} m/s^2 at slip "
            f"{self.slip:.2g}: {self.pull:.3g} N; its standard deviation is {self.known_std:.2g} N "
            f"without a test, {self.best.pull_std:.2g} N expected after the best one"
        )
        yield Remark("transfer", text, severity="note")
        if self.change.is_open:
            text = (
                f"no test under {self.change.tested:.3g} m/s^2 tells the law of gravity: with the "
                f"soil known, {self.least_std:.2g} N are left, a 90 % band of about "
                f"{self.least_width:.2g} N"
            )
            yield Remark("law-untold", text)
        text = "the model is quasi-static; speed_ratio keeps v^2 / (g r), as granular scaling asks"
        yield Remark("quasi-static", text, severity="note")
        if self.excluded:
            text = f"{self.excluded} tests are excluded: a twentieth or more of the soils does not "
            yield Remark("not-carried", f"{text}carry them")


def advise_transfer(
    case: Case,
    samples: ParameterSamples,
    change: GravityChange,
    load: float,
    slip: float = TARGET_SLIP,
    *,
    loads: Sequence[float] | None = None,
    radii: Sequence[float] | None = None,
    slips: Sequence[float] | None = None,
    covariates: Mapping[str, float] | None = None,
) -> TransferAdvice:
    r"""Rate tests under one gravity by the pull under another that is expected after them.

    .. math::
        E \operatorname{Var}(P | y) = E \operatorname{Var}(m(\theta) | y)
        + E \operatorname{Var}(P | \theta), \quad m(\theta) = E(P | \theta)

    over soils theta, laws of gravity and readings y. The second term is the law's: y does not
    depend on it, and no test changes it. All channels with declared noise are read.

    case: Of one wheel, with its noise.
    samples: What is known of the soil.
    load, slip: Of the pull there; load in N.
    loads, radii, slips: Of the tests, N and m. Loads are by default from the one there to that of
        the same mass, radii that of the gear; a test has rows at all slips.
    covariates: Further fields of `Operating`.

    Raises `InputError` for a load, slip or radius that cannot be driven, another gear than a wheel,
    and where no noise is declared; `FitError` where the wheel there, or every test, is not carried.

    References: Chaloner and Verdinelli, Statistical Science 10, 1995. Equal Froude number, and pull
    in proportion to load: Slonaker and others, Phys. Rev. E 95, 052901, 2017.
    """
    same_mass = load / change.ratio
    if loads is None and load > 0.0:
        loads = [float(one) for one in np.geomspace(load, same_mass, LOADS)]
    candidate_grid([*(slips or SLIPS), slip], [load, *(loads or ())])
    if case.simulator is not None or "gear.radius" not in case.parameters():
        raise InputError("tests for another gravity are rated for a wheel in [gear]")
    soils = {f.path: f.prior.at(samples.u[:, i]) for i, f in enumerate(samples.free)}
    others, weights = dict(covariates or {}), samples.weights
    pull = _pull_there(case.with_values(soils), change, load, slip, others)
    failed = float(np.isnan(pull).mean(axis=0) @ weights)
    if failed >= MOST_FAILURE:
        raise FitError(
            f"{failed:.0%} of the soils do not carry {load:.4g} N under {change.target:.3g} m/s^2; "
            "try a smaller load"
        )
    pull = np.where(np.isfinite(pull), pull, np.nanmean(pull))
    mean = pull.mean(axis=0)
    centred = mean - float(weights @ mean)
    spread, law = float(weights @ centred**2), float(weights @ pull.var(axis=0))

    def rated(own_load: float, radius: float) -> TransferTest | None:
        wheel = case.with_values({"gear.radius": radius})
        at = [*(slips or SLIPS), slip]
        full = {key: np.full(len(at), value) for key, value in others.items()}
        points = Operating(slip=np.asarray(at), load=np.full(len(at), own_load), **full)
        predicted = predicted_readings(wheel, samples, points)
        if not predicted.drivable.all():
            return None
        outcomes = expected_variance(samples, len(predicted.channels))
        rows = [
            outcomes.with_noise(k).log_likelihood(predicted, predicted.channels, k)
            for k in range(len(at) - 1)
        ]
        left = float(outcomes.variance_of(np.sum(rows, axis=0), centred[:, None])[0])
        here = Operating(slip=np.full(len(mean), slip), load=own_load, **others)
        measured = np.asarray(forces_of_one_gear(wheel.with_values(soils), here).drawbar_pull)
        noise = case.noise.get(column("drawbar_pull"))
        error = (pull - measured * load / own_load) ** 2
        if noise is not None:
            error = error + (noise.std(measured) * load / own_load) ** 2
        kept = np.isfinite(measured)
        scaled = np.sqrt(np.average(error[:, kept].mean(axis=0), weights=weights[kept]))
        speed = np.sqrt(radius / (change.ratio * own_radius))
        std = np.sqrt(min(left, spread) + law)
        return TransferTest(own_load, radius, float(std), float(scaled), float(speed))

    own_radius = float(case.numbers["gear.radius"])
    tried = {(one, r) for one in loads or () for r in (own_radius, *(radii or ()))}
    tried |= {(load, own_radius), (same_mass, own_radius)}
    for _, radius in tried:
        if not 0.0 < radius < 100.0:
            raise InputError(f"radius {radius:g} m; needed is one above 0 m, up to 100")
    found = {point: test for point in sorted(tried) if (test := rated(*point)) is not None}
    if not found:
        raise FitError("no test is carried by the soils that are still possible; try smaller loads")
    return TransferAdvice(
        change,
        load,
        slip,
        tuple(found.values()),
        found.get((load, own_radius)),
        found.get((same_mass, own_radius)),
        float(weights @ mean),
        float(np.sqrt(spread + law)),
        float(np.sqrt(law)),
        float(weights @ quantile_band(pull).width),
        len(tried) - len(found),
    )


def _pull_there(
    case: Case, change: GravityChange, load: float, slip: float, others: Mapping[str, float]
) -> Floats:
    """The pull of soils (n,) by draws of the law, N (laws, n); NaN where not carried."""
    soil = {name: case.numbers[name] for name in located(case.soil)}
    there = case.with_values(change.parameters(soil, change.draws(LAW_DRAWS).as_column()))
    shape = np.broadcast_shapes(*(np.shape(v) for v in there.numbers.values()), (LAW_DRAWS, 1))
    at = Operating(slip=np.full(shape, slip), load=load, **others)
    return np.asarray(forces_of_one_gear(there, at).drawbar_pull)
