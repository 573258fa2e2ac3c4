"""The likelihood of a set for a microcontroller: fewer unknowns, and systems that stay small."""

from __future__ import annotations

from dataclasses import dataclass, replace

from training.onnx_graph.value import Value, concat
from training.set_posterior.columns import integrate_out_columns, triangular_factor
from training.set_posterior.families.wheel_family import ContextValues, WheelFamily
from training.set_posterior.likelihood import OF_MODEL, OF_SENSORS, SetReadings
from training.set_posterior.linear_unknowns import LinearUnknowns
from training.set_posterior.response_surface import Response
from training.set_posterior.scale_mixture import ScaleMixture


@dataclass(frozen=True)
class SmallLikelihood:
    r"""The likelihood in the unknowns that are not nearly known.

    The system of all readings has the columns E of errors of the model, and A of monomials, after
    errors of sensors and nearly known unknowns were integrated out. Its triangular factor

    .. math:: [E \; A] = Q \begin{bmatrix} R_E & R_{EA} \\ 0 & R_A \end{bmatrix}

    has as few rows as columns, and a model's errors e change its first rows alone:
    :math:`|R_E e + R_{EA} b|^2 + |R_A b|^2`.
    """

    family: WheelFamily  # with the sampled unknowns alone
    response: Response  # in these
    context: ContextValues  # without nearly known unknowns
    readings: SetReadings
    terms: int  # monomials of the readings
    linear: LinearUnknowns | None

    noise_alone = None  # There are errors at all times: this is for C, which leaves nothing out

    @staticmethod
    def of(
        family: WheelFamily, response: Response, context: ContextValues, readings: SetReadings
    ) -> SmallLikelihood:
        """Of a family of wheels with all unknowns."""
        terms, linear = len(response.terms), None
        if context.axis_std is not None:
            linear = LinearUnknowns.of(response, family.free, context.axis_std)
            family, response = family.with_axes(family.free), linear.sampled
        context = replace(context, axis_std=None)
        return SmallLikelihood(family, response, context, readings, terms, linear)

    def start(self) -> Value:
        """Residuals (terms, terms) of a model without errors, those of sensors integrated out.

        Errors of new readings are linear in the middle of the prior's range.
        """
        first, (sensors,) = self._split(self.readings.rows.columns_at(None), 0)
        own = [first] if self.linear is None else self.linear.in_the_middle(first)
        columns = concat([*own, sensors], axis=0)
        sampled = len(self.response.terms)
        return triangular_factor(integrate_out_columns(columns, sampled, self._taken), sampled)

    def mixture_at(self, basis: Value) -> tuple[ScaleMixture, Value]:
        """The likelihood with errors linear at a soil, and the state with the new rows.

        basis: Monomials (terms, 1) of the soil.
        """
        rows, sampled = self.readings.rows, len(self.response.terms)
        soil, unit = basis, basis
        if self.linear is not None:  # the columns are put together again, as they are large
            soil, unit = self.linear.soil(self._split(rows.columns_at(None), 0)[0], basis)
        new = rows.columns_at(soil)
        grown = concat([self.readings.state, rows.compressed(new)], axis=0)
        whole, (of_sensors, of_model) = self._split(new, OF_MODEL)
        parts = [whole] if self.linear is None else self.linear.at(whole, soil, unit)
        columns = concat([of_model, *parts, of_sensors], axis=0)
        columns = integrate_out_columns(columns, OF_MODEL + sampled, self._taken)
        factor = triangular_factor(columns, OF_MODEL + sampled)
        with_errors, without = factor.split([OF_MODEL, sampled], axis=0)
        errors, monomials = with_errors.split([OF_MODEL, sampled], axis=1)
        _, common = without.split([OF_MODEL, sampled], axis=1)
        system = concat([monomials, errors], axis=1)
        return replace(self.readings.mixture_of(system, sampled), common=common), grown

    @property
    def _taken(self) -> int:
        """Number of columns of errors of sensors and of linear unknowns."""
        return OF_SENSORS + (len(self.linear.axes) if self.linear else 0)

    def _split(self, new: Value, errors: int) -> tuple[Value, list[Value]]:
        """Columns of the monomials, and of errors of sensors and model, earlier rows first."""
        old = self.readings.state.node("Transpose")
        if not errors:
            old, _ = old.split([self.terms + OF_SENSORS, OF_MODEL], axis=0)
        columns = concat([old, new], axis=1)
        parts = [self.terms, OF_SENSORS, errors] if errors else [self.terms, OF_SENSORS]
        whole, *others = columns.split(parts, axis=0)
        return whole, others
