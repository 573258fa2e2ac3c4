"""Readings of a set as rows of one linear system of monomials, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilml.onboard.set_contract import (
    ERROR_COLUMNS,
    LAW_ERROR_COLUMNS,
    MODEL_ERROR_COLUMNS,
    MODEL_ERROR_INPUT,
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    RESPONSE_CHANNELS,
    SENSOR_ERROR_COLUMNS,
)
from soilml.quantities import SHEAR
from training.onnx_graph.value import (
    Value,
    absolute,
    concat,
    constant,
    either_of,
    exp,
    gemm,
    log,
    maximum,
    sqrt,
)
from training.set_posterior.error_scales import OF_CHANNELS
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    WheelFamily,
)
from training.set_posterior.monomials import ONE, derivative
from training.set_posterior.response_surface import Response, ResponseValues
from training.set_posterior.scale_mixture import integrate_out

CHANNELS = len(RESPONSE_CHANNELS)
#: Columns of errors of the system: those of sensors alone, and those of the model too.
OF_ERRORS = (len(SENSOR_ERROR_COLUMNS), len(ERROR_COLUMNS))
#: Tolerance of the box of features, as a share of its width: float32 rounds readings at its ends.
BOX_TOLERANCE = 1e-3
#: Rows that are out of range by up to so many standard deviations of slip or load are left out, but
#: do not count against the set.
NOISE_MARGIN = 3.0
#: Drawbar pull over load, which has no logarithm, may have any noise; absent readings have far
#: more.
MOST_PULL_NOISE = 1e3
FRICTION = "friction_angle"
#: Unknowns that the strength, the shear modulus and the cohesion consist of.
LAW_UNKNOWNS = (("cohesion", FRICTION), ("shear_modulus",), ("cohesion",))
GROWS = "_by_slip"  # End of the names of errors that grow with slip


@dataclass(frozen=True)
class ResidualRows:
    """Residuals of a set's readings, linear in the monomials of the unknowns.

    A row of the system is (w a, w g): the coefficients a of a channel's polynomial less the
    reading, over the standard deviation 1 / w of the noise, and the changes g of that residual with
    one standard deviation of each error that all rows share, in the order of `ERROR_COLUMNS`.

    Until the system is complete its columns are kept as rows (columns, readings), where a reading
    is one channel of one row: so they are joined without a copy of each. Readings of the complete
    system are ordered by row.
    """

    family: WheelFamily
    response: Response
    context: ContextValues
    readings: dict[str, Value]  # readings and standard deviations by input name
    operating: Value  # (2, rows) slip and load, at least `SMALLEST`
    operating_noise: Value  # (2, rows) of their logarithms
    y: Value  # (channels, rows) readings on the scales of the channels
    slope: Value  # (channels, rows) derivatives of these scales by the readings
    weight: Value  # (1, readings), 0 for readings that are left out
    used: Value  # (readings,) whether a reading takes part
    values: ResponseValues  # the response surface at the rows, unweighted
    in_range: Value  # (rows,) whether the features lie in the range of the response surface
    counts: Value  # (3,) float32: readings in the system, rows, rows in range within their noise

    def columns_at(self, basis: Value | None) -> Value:
        r"""The system (readings, terms + errors) of new rows, with errors linear at one soil.

        Errors of a row's slip and load are part of all its channels. With d the changes of its
        weighted residuals with one standard deviation of such an error, their covariance is
        :math:`I + \sum d d^T`, by which the row is whitened.

        basis: Monomials (terms, 1) of the soil at which the residuals' derivatives by slip and load
            and the other errors are taken; None is the middle of the prior's range, and the system
            is then without columns of errors of the model.
        """
        middle = constant(self.weight.graph, np.eye(len(self.response.terms), 1))
        slopes = self.values.slopes_at(middle if basis is None else basis)
        of_residuals = self._slopes_of_residuals(slopes)
        parts = [self.values.coefficients, self._sensor_columns(of_residuals)]
        if basis is not None:
            size = self.readings[MODEL_ERROR_INPUT]
            parts += either_of(
                size * size > 0.0,
                lambda: [self._model_columns(slopes, basis)],
                lambda: [self.weight * np.zeros((len(MODEL_ERROR_COLUMNS), 1))],
            )
        noise = self.operating_noise.reshape(2, 1, -1)
        of_row = (of_residuals * noise).reshape(2, -1)
        system = concat([*parts, of_row], axis=0) * self.weight
        by_row = system.reshape(0, CHANNELS, -1).node("Transpose", perm=[2, 1, 0])
        whitened, _ = integrate_out(by_row, len(OPERATING_NOISE))
        columns = len(self.response.terms) + OF_ERRORS[basis is not None]
        return whitened.reshape(-1, columns)

    def _slopes_of_residuals(self, slopes: Value) -> Value:
        r"""Derivatives (2, channels, rows) of residuals by log slip and log load.

        The reading of slip is s + e. The residual of channel k, :math:`f_k(s + e) - y_k`, changes
        by :math:`f_k' e`. An error of load changes torque over load and drawbar pull over load as
        well: with the relative error e of load, the residuals of the three channels change by
        :math:`(f_1' + 1) e`, :math:`f_2' e` and :math:`(f_3' + f_3) e`, with f' the derivatives by
        the logarithm of load.

        slopes: Derivatives (2, channels, rows) of the channels at a soil.
        """
        torque, pull = np.zeros((2, 2, CHANNELS, 1))
        torque[1, 0], pull[1, 2] = self.context.torque_by_load, 1.0
        return slopes + (self.y * pull + torque)

    def _sensor_columns(self, slopes: Value) -> Value:
        """Columns (errors, readings) of errors of the sensors, by slopes of the residuals."""
        slip, load = self.operating.split(2, axis=0)
        shared = [self.readings["slip_bias"] / slip, self.readings["load_gain"] + load * 0.0]
        of_operating = slopes * concat(shared, axis=0).reshape(2, 1, -1)
        readings = self.readings
        none = readings["load"] * 0.0
        stds = [readings["torque_bias"]]
        stds += [readings[f"{name}_bias"] + none for name in RESPONSE_CHANNELS[1:]]
        offsets = concat([*stds, readings["torque_gain"] * readings["torque"]], axis=0)
        # row k has the offset of channel k; the last has the gain of torque
        channel_of_row = np.eye(CHANNELS + 1, CHANNELS)[..., None]
        channel_of_row[-1, 0] = 1.0
        scale = self.slope * channel_of_row
        of_channels = scale * offsets.reshape(CHANNELS + 1, 1, -1)
        return concat([of_channels.reshape(CHANNELS + 1, -1), of_operating.reshape(2, -1)], axis=0)

    def _model_columns(self, slopes: Value, basis: Value) -> Value:
        r"""Columns (errors, readings) at a soil, in the order of `MODEL_ERROR_COLUMNS`.

        Changes with the bearing modulus k follow from those with load W and cohesion c. On a soil
        that is stronger by some factor, under a load that is larger by the same factor, T / W,
        sinkage and P / W are what they were, for every law of stress in which strength is c, k or a
        multiple of them:

        .. math:: \frac{\partial f}{\partial \ln k} =
            - \frac{\partial f}{\partial \ln W} - \frac{\partial f}{\partial \ln c}

        A scale of torque without load changes with the logarithm of torque itself in addition.
        The strength is cohesion and the tangent of the friction angle. Errors are of usual size.

        slopes: Derivatives of the channels by log slip and log load, at the same soil, (2,
            channels, rows).
        basis: Monomials (terms, 1) of the soil.
        """
        stds, slope = self.family.model_errors(), self.slope
        slip, load, torque = (self.readings[name] for name in ("slip", "load", "torque"))
        log_load = log(maximum(load, SMALLEST)) - self.context.reference_log_load
        bearing = [
            slip * 0.0 + stds["bearing"],
            slip * stds["bearing_by_slip"],
            log_load * stds["bearing_by_load"],
        ]
        profile = concat(bearing, axis=0).reshape(3, 1, -1)
        first = np.zeros((CHANNELS, 1))
        first[0] = 1.0
        of_torque = first * (1.0 - self.context.torque_by_load)
        change = slope * torque * of_torque - slopes.take([1], axis=0)  # (1, channels, rows)
        of_strength, of_modulus, of_cohesion = self._by_logarithms(basis).split(3, axis=0)
        change = change - of_cohesion
        contact = change * 0.0
        if self.response.contact is not None:
            at_soil = self.response.contact.add_at_soil(self.context.features, basis)
            contact = at_soil.reshape(1, CHANNELS, -1) * stds["contact"]
        # relative errors (errors, channels, rows) of single channels; of pull, over load
        names = MODEL_ERROR_COLUMNS[OF_CHANNELS : -len(LAW_ERROR_COLUMNS)]
        constant_part, growing = np.zeros((2, len(names), CHANNELS, 1))
        for number, name in enumerate(names):
            part = growing if name.endswith(GROWS) else constant_part
            part[number, RESPONSE_CHANNELS.index(name.removesuffix(GROWS))] = stds[name]
        own = (slope * torque * first + (1.0 - first)) * (slip * growing + constant_part)
        laws = [
            of_strength * stds["strength"],
            of_strength * (log_load * stds["strength_by_load"]).reshape(1, 1, -1),
            of_modulus * stds["shear_modulus"],
        ]
        columns = concat([change * profile, contact, own, *laws], axis=0)
        return columns.reshape(len(MODEL_ERROR_COLUMNS), -1)

    def _by_logarithms(self, basis: Value) -> Value:
        r"""Changes (3, channels, rows) with the logarithms of strength, modulus and cohesion.

        .. math:: \frac{\partial b}{\partial \ln \theta} = D b \, \frac{\theta}{d\theta / dx}

        Of a friction angle it is the logarithm of its tangent, with sin(theta) cos(theta) for
        theta. They are nil where the family has none of these unknowns.

        basis: Monomials (terms, 1) of the soil.
        """
        terms, linear = self.response.terms, (ONE,) * (len(self.response.terms[0]) - 1)
        axes = [(k, axis) for k, axis in enumerate(self.family.axes, 1) if axis.name in SHEAR]
        shift, factor, rate, slope = (
            np.asarray([[getattr(axis, name)] for _, axis in axes])
            for name in ("shift", "factor", "rate", "slope")
        )
        x = basis.take([terms.index((*linear, k)) for k, _ in axes], axis=0)
        growth = exp(x * rate) * factor
        value, by_x = growth + x * slope + shift, growth * rate + slope
        angle = np.asarray([[float(axis.name == FRICTION)] for _, axis in axes])
        value = value * (1.0 - angle) + (value * 2.0).node("Sin") * (0.5 * angle)
        matrices = np.stack([derivative(terms, k) for k, _ in axes])
        places = np.abs(matrices).argmax(axis=2)
        factors = np.take_along_axis(matrices, places[..., None], 2)[..., 0]
        by_axis = basis.node("Gather", basis.indices(places), axis=0).reshape(len(axes), -1)
        kinds = np.asarray([[float(a.name in kind) for _, a in axes] for kind in LAW_UNKNOWNS])
        by_log = kinds @ (by_axis * factors * (value / by_x))
        return gemm(by_log, self.values.coefficients).reshape(len(kinds), CHANNELS, -1)


def add_residual_rows(
    family: WheelFamily, response: Response, readings: dict[str, Value]
) -> ResidualRows:
    r"""Residuals of the three channels of each row, as polynomials of the unknowns.

    .. math:: e_k(x) = \frac{\sum_j a_{kj} b_j(x) - y_k}{\sqrt{\sigma_k^2 + \epsilon_k^2}}

    with y the torque on the scale of the response, the logarithm of sinkage over length, or drawbar
    pull over load, sigma its noise on that scale, and epsilon the error of the response surface.
    Readings out of range, or with too much noise for a logarithm, are left out.

    readings: Readings and standard deviations (1, rows), and inputs of the whole set (1,), by name.
    """
    context = family.add_context(readings)
    operating = maximum(concat([readings[name] for name in OPERATING_NOISE], axis=0), SMALLEST)
    stds = concat([readings[name] for name in OPERATING_STD_INPUTS], axis=0)
    operating_noise = stds / operating
    middle = 0.5 * (response.upper + response.lower)[:, None]
    features = context.features
    outside = absolute(features - constant(features.graph, middle, name="range_middle"))
    within = _all_below(response, outside)  # (rows,) float32
    in_range = within.astype(np.bool_)
    one = constant(outside.graph, 1.0)
    sinkage = maximum(readings["sinkage"], SMALLEST)
    per_load = one / readings["load"]
    # derivatives of the three scales by torque, sinkage and drawbar pull
    slope = concat([context.torque_slope, one / sinkage, per_load], axis=0)
    noise = concat([readings[f"{name}_std"] for name in RESPONSE_CHANNELS], axis=0) * slope
    log_sinkage = log(sinkage / context.length)
    y = concat([context.torque, log_sinkage, readings["drawbar_pull"] * per_load], axis=0)
    most_noise = np.asarray([[context.most_torque_noise], [MOST_RELATIVE_NOISE], [MOST_PULL_NOISE]])
    used = (noise < most_noise).astype(np.float32) * within  # (channels, rows)
    weight = used / sqrt(noise * noise + response.error[:, None] ** 2)
    values = response.add_to(features, y, context.feature_slopes)
    # rows may be out of range by their noise: a slip at the end of the range is so half the time
    margin = -NOISE_MARGIN * np.abs(context.feature_slopes.T)
    outside_noise = gemm(constant(outside.graph, margin), operating_noise, outside)
    counts = [
        used.sum(keepdims=False).reshape(1),
        in_range.node("Shape").astype(np.float32),
        _all_below(response, outside_noise).sum(),
    ]
    read = (readings, operating, operating_noise, y, slope)
    by_row = used.node("Transpose").reshape(-1).astype(np.bool_)
    system = (weight.reshape(1, -1), by_row, values, in_range)
    return ResidualRows(family, response, context, *read, *system, concat(counts, axis=0))


def _all_below(response: Response, distance: Value) -> Value:
    """1 where all distances (f, rows) are within the box of the designs, else 0, (rows,).

    Distances that are not numbers, of a wheel without size, are not.
    """
    half_width = (0.5 + BOX_TOLERANCE) * (response.upper - response.lower)[:, None]
    inside = (distance <= constant(distance.graph, half_width, name="range_half")).astype(
        np.float32
    )
    return inside.reduce("ReduceMin", axis=0, keepdims=False)
