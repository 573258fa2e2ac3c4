r"""The likelihood of a set, from the rows of its linear system, as composites of a graph.

A row of the system is (w a, w g, w e): a reading's monomials, and its changes with errors of the
sensors and of the model that all readings share. Errors of the sensors are integrated out, those of
the model for each of their scales.

Nearly known unknowns z have a normal prior. They are errors, in which residuals are linear:

.. math:: r(x, z) \approx A \, b(x, \bar z)
    + \sum_a (z_a - \bar z_a) \, A \frac{\partial b}{\partial z_a}(\bar x, \bar z),
    \qquad z_a \sim N(0, \sigma_a^2)

A point in three dimensions tells more than one in five.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add, mul

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS, SENSOR_ERROR_COLUMNS
from training.onnx_graph.value import Value, composite, concat, constant, gemm
from training.set_posterior.draws import ProposalDraws, SampleSizes
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.monomials import ONE, Terms, derivative
from training.set_posterior.residual_system import ResidualRows
from training.set_posterior.sampler import Polynomials, adapted_rounds, first_round
from training.set_posterior.scale_mixture import integrate_out, scale_mixture

#: Columns of errors in the residual system: of the sensors, and of the model.
OF_SENSORS, OF_MODEL = len(SENSOR_ERROR_COLUMNS), len(MODEL_ERROR_COLUMNS)
#: Sweeps over the linear unknowns, one solved after another, to their likeliest values at a soil.
SWEEPS = 2


@dataclass(frozen=True)
class Linear:
    """Nearly known unknowns z as errors that all readings share."""

    terms: Terms
    sampled: Terms  # without z
    parts: Floats  # (sampled terms, terms): which terms have which factor without z
    axes: tuple[int, ...]  # numbers of the linear unknowns, counted from 1
    std: Value  # (z, 1) standard deviations of their coordinates

    @staticmethod
    def of(terms: Terms, free: int, std: Value) -> Linear:
        """Of unknowns after the first `free`, with standard deviations (unknowns, 1)."""
        sampled: Terms = tuple(term for term in terms if max(term) <= free)
        parts = np.zeros((len(sampled), len(terms)))
        for column, term in enumerate(terms):
            own = tuple(sorted(factor if factor <= free else ONE for factor in term))
            parts[sampled.index(own), column] = 1.0
        axes = tuple(sorted({factor for term in terms for factor in term if factor > free}))
        return Linear(terms, sampled, parts, axes, std.take([a - 1 for a in axes], axis=0))

    def in_the_middle(self) -> Value:
        """The columns (terms, sampled + z) of x and z, linear in the middle of the prior.

        There the monomials of z change with z alone, by one standard deviation.
        """
        linear = [(*(ONE,) * (len(self.terms[0]) - 1), axis) for axis in self.axes]
        places = [self.terms.index(term) for term in (*self.sampled, *linear)]
        ones = np.ones((1, len(self.sampled)))
        scale = concat([constant(self.std.graph, ones), self.std.reshape(1, -1)], axis=1)
        return np.eye(len(self.terms))[:, places] * scale

    def at(self, soil: Value, system: dict[str, Value]) -> tuple[Value, Value]:
        """Monomials (terms, 1) of x and the likeliest z, and the columns, linear there.

        soil: Monomials (sampled terms, 1) of x.
        system: State, columns and use of the readings.
        """
        whole, columns = composite(
            "LikeliestSoil", ["whole", "unknowns"], self._likeliest, **system, soil=soil,
            std=self.std, part=soil.indices(self.parts.T.argmax(axis=1)),
            powers=soil.indices([[term.count(axis) for term in self.terms] for axis in self.axes]),
            derivatives=soil.indices(
                [derivative(self.terms, axis).argmax(axis=1) for axis in self.axes]
            ),
        )  # fmt: skip
        return whole, columns

    def _likeliest(
        self, state: Value, columns: Value, used: Value, soil: Value, std: Value, part: Value,
        powers: Value, derivatives: Value,
    ) -> list[Value]:  # fmt: skip
        """The likeliest values of z, one after another, each from its residuals' change."""
        system, _ = _joined(state, columns, used, [OF_SENSORS])
        of_x, count = soil.node("Gather", part, axis=0), len(self.axes)
        powers = powers.astype(np.float32)
        stds, rows = std.split(count, axis=0), powers.split(count, axis=0)
        places = derivatives.split(count, axis=0)
        units = [constant(soil.graph, [[0.0]]) for _ in self.axes]

        def at_units() -> tuple[Value, Value, list[Value]]:
            factors = [
                (unit * one).node("Pow", row).reshape(-1, 1)
                for unit, one, row in zip(units, stds, rows, strict=True)
            ]
            of_z = reduce(mul, factors)
            whole = of_x * of_z
            changes = [
                whole.node("Gather", place.reshape(-1), axis=0) * row.reshape(-1, 1) * one
                for place, row, one in zip(places, rows, stds, strict=True)
            ]
            return of_z, whole, changes

        for _ in range(SWEEPS):
            for place in range(count):
                _, whole, changes = at_units()
                own = system @ changes[place]
                residual = system @ whole - own * units[place]
                against = gemm(own, residual, transpose_a=True)
                units[place] = -against / (own.sum_of_squares(keepdims=True) + 1.0)
        of_z, whole, changes = at_units()
        first = np.eye(1, len(self.sampled))
        offset = reduce(add, (c * u for c, u in zip(changes, units, strict=True)))
        in_x = self.parts.T * of_z - offset * first
        return [whole, concat([in_x, *changes], axis=1)]


def _joined(state: Value, columns: Value, used: Value, errors: list[int]) -> list[Value]:
    """Columns of monomials, and of kinds of errors, of earlier and of new readings, each (m, k).

    state: System (kept, terms + errors) of earlier readings.
    columns: Of new readings, (readings, terms + errors).
    used: Whether each of them takes part.
    errors: Numbers of columns of each kind, which may be fewer than those of the state.
    """
    new = columns.node("Compress", used, axis=0)
    if lacking := OF_SENSORS + OF_MODEL - sum(errors):
        state, _ = state.last_columns(lacking)
    return concat([state, new], axis=0).last_columns(*errors)


@dataclass(frozen=True)
class Likelihood:
    """What is sampled of a set's readings."""

    polynomials: Polynomials  # monomials of the sampled unknowns
    rows: ResidualRows  # new readings
    state: Value  # residual system (kept, terms + errors) of earlier ones
    size: Value  # of the errors of the model, (1,)
    scales: ErrorScales  # their sizes where that is inferred
    present: tuple[bool, ...]  # which of `MODEL_ERROR_COLUMNS` the model can have
    nearly_known: Linear | None  # unknowns in which residuals are linear, if there are some
    sizes: SampleSizes
    targets: int  # estimated unknowns

    def sampled(self, prior: ProposalDraws, adapted: ProposalDraws, limit: Value) -> list[Value]:
        """Points (1 + p, n), weights (1, n), least misfit (1,), and the state with the new rows."""
        system = {
            "state": self.state, "columns": self.rows.columns_at(None), "used": self.rows.used,
        }  # fmt: skip
        linear = self.nearly_known
        given = {} if linear is None else {"unknowns": linear.in_the_middle()}
        graph, polynomials = self.size.graph, self.polynomials
        # what follows is for C, which has these methods as templates
        of_c = {
            "terms": self.size.indices(polynomials.rows),
            "tilts": constant(graph, polynomials.tilts, name="tilts"),
        }
        of_columns, probabilities = self.scales.judged_first()
        present = np.flatnonzero(self.present)
        of_scales = {
            "present": self.size.indices(present),
            "scales": constant(graph, of_columns[:, present], name="scales"),
            "log_probabilities": constant(graph, np.log(probabilities), name="log_probabilities"),
            "rounds": self.size.indices([self.sizes.rounds]),
            "targets": self.size.indices([self.targets]),
        }  # fmt: skip
        soil, *first = composite(
            "FirstRound", ["soil", "solved", "free", "outside"], self._first_body,
            **system, **given, **dict(zip(("draws", "t", "log_prior"), prior, strict=True)), **of_c,
        )  # fmt: skip
        if linear is not None:
            soil, given["unknowns"] = linear.at(soil, system)
        system["columns"] = self.rows.columns_at(soil)
        return composite(
            "Posterior", ["points", "weights", "misfit", "grown"],
            self._posterior_body, **system, **given, size=self.size, limit=limit,
            prior=prior.normal, **dict(zip(("solved", "free", "outside"), first, strict=True)),
            **adapted._asdict(), **of_scales,
        )  # fmt: skip

    def _first_body(
        self, state: Value, columns: Value, used: Value, draws: Value, t: Value, log_prior: Value,
        unknowns: Value | None = None, **_: Value,
    ) -> list[Value]:  # fmt: skip
        """From readings to the first round, with errors linear in the middle of the prior."""
        whole, sensors = _joined(state, columns, used, [OF_SENSORS])
        system = self._without_sensors([], whole, sensors, unknowns)
        system = system.node("Squeeze", system.indices([0]))
        return first_round(self.polynomials, system, draws, t, log_prior)

    def _posterior_body(
        self, state: Value, columns: Value, used: Value, size: Value, limit: Value, prior: Value,
        solved: Value, free: Value, outside: Value, normal: Value, t: Value, log_density: Value,
        unknowns: Value | None = None, **_: Value,
    ) -> list[Value]:  # fmt: skip
        """From readings, with errors linear at a soil, to the sample of the posterior."""
        whole, sensors, model = _joined(state, columns, used, [OF_SENSORS, OF_MODEL])
        grown = concat([whole, sensors, model], axis=1)
        present = np.flatnonzero(self.present).tolist()
        model = model.take(present, axis=1)
        system = self._without_sensors([model], whole, sensors, unknowns)
        system, model = system.last_columns(len(present))
        mixture = scale_mixture(system, model, size, self.scales, self.present)
        first, draws = (prior, solved, free, outside), ProposalDraws(normal, t, log_density)
        sizes, targets = self.sizes, self.targets
        found = adapted_rounds(self.polynomials, mixture, limit, targets, sizes, first, draws)
        return [*found, grown]

    def _without_sensors(
        self, others: list[Value], whole: Value, sensors: Value, unknowns: Value | None
    ) -> Value:
        """Columns (1, m, k) of the sampled monomials and others, without errors of the sensors.

        The nearly known unknowns are integrated out as these are.
        """
        of_z, linear = list[Value](), 0
        if self.nearly_known is not None and unknowns is not None:
            linear = len(self.nearly_known.axes)
            whole, *of_z = (whole @ unknowns).last_columns(linear)
        system = concat([whole, *others, *of_z, sensors], axis=1)
        systems = system.node("Unsqueeze", system.indices([0]))
        return integrate_out(systems, OF_SENSORS + linear)[0]
