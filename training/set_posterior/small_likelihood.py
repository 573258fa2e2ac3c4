"""The likelihood of a set for a microcontroller: fewer unknowns, and systems that stay small."""

from __future__ import annotations

from dataclasses import replace

from training.onnx_graph.value import Value, concat
from training.set_posterior.columns import integrate_out_columns, triangular_factor
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.likelihood import OF_MODEL, OF_SENSORS, Likelihood, SetReadings
from training.set_posterior.linear_unknowns import LinearUnknowns
from training.set_posterior.response_surface import Response
from training.set_posterior.scale_mixture import ScaleMixture, add_scale_mixture


def add_small_likelihood(
    family: WheelFamily, response: Response, context: ContextValues, readings: SetReadings
) -> Likelihood:
    r"""The likelihood in the unknowns that are not nearly known.

    The system of all readings has the columns E of errors of the model, and A of monomials, after
    errors of sensors and nearly known unknowns were integrated out. Its triangular factor

    .. math:: [E \; A] = Q \begin{bmatrix} R_E & R_{EA} \\ 0 & R_A \end{bmatrix}

    has as few rows as columns, and a model's errors e change its first rows alone:
    :math:`|R_E e + R_{EA} b|^2 + |R_A b|^2`.
    """
    terms, linear = len(response.terms), None
    if context.axis_std is not None:
        linear = LinearUnknowns.of(response, family.free, context.axis_std)
        family, response = family.with_axes(family.free), linear.sampled
    sampled, taken = len(response.terms), OF_SENSORS + (len(linear.axes) if linear else 0)

    def split(new: Value, errors: int) -> tuple[Value, list[Value]]:
        """Columns of the monomials, and of errors of sensors and model."""
        old = earlier = readings.state.node("Transpose")
        if not errors:
            old, _ = earlier.split([terms + OF_SENSORS, OF_MODEL], axis=0)
        columns = concat([old, new], axis=1)
        parts = [terms, OF_SENSORS, errors] if errors else [terms, OF_SENSORS]
        whole, *others = columns.split(parts, axis=0)
        return whole, others

    of_middle = readings.rows.columns_at(None)
    first, (sensors,) = split(of_middle, 0)
    own = [first] if linear is None else linear.in_the_middle(first)
    start = integrate_out_columns(concat([*own, sensors], axis=0), sampled, taken)

    def mixture_at(basis: Value) -> ScaleMixture:
        soil, unit = basis, basis
        if linear is not None:  # the columns are put together again, as they are large
            soil, unit = linear.soil(split(of_middle, 0)[0], basis)
        new = readings.rows.columns_at(soil)
        kept = readings.rows.compressed(new)
        concat([readings.state, kept], axis=0).named(readings.grown)
        whole, (of_sensors, of_model) = split(new, OF_MODEL)
        parts = [whole] if linear is None else linear.at(whole, soil, unit)
        columns = concat([of_model, *parts, of_sensors], axis=0)
        columns = integrate_out_columns(columns, OF_MODEL + sampled, taken)
        factor = triangular_factor(columns, OF_MODEL + sampled)
        with_errors, without = factor.split([OF_MODEL, sampled], axis=0)
        errors, monomials = with_errors.split([OF_MODEL, sampled], axis=1)
        _, common = without.split([OF_MODEL, sampled], axis=1)
        system = concat([monomials, errors], axis=1)
        return replace(
            add_scale_mixture(system, readings.size, sampled, readings.scales), common=common
        )

    return Likelihood(
        family,
        response,
        replace(context, axis_std=None),
        lambda: triangular_factor(start, sampled),
        mixture_at,
    )
