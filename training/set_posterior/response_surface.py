"""The response surface of a wheel: polynomials in the unknowns with learned coefficients."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.set_contract import RESPONSE_CHANNELS
from soilml.processes import process_map
from training.onnx_graph.value import Value, concat, constant, gemm, tanh
from training.regressors.gaussian_regressor import Standardisation
from training.regressors.tanh_network import TanhNetwork, evaluate_layers, one_cycle_rate
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScales
from training.set_posterior.families.coordinates import prior_points
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.monomials import Terms, monomial_terms, monomials, select_terms

Progress = Callable[[str, int, int], None]

CHANNELS = len(RESPONSE_CHANNELS)


@dataclass(frozen=True)
class ResponseValues:
    """Graph values of a response surface for rows of readings, float32.

    A reading is one channel of one row; readings are numbered by channel, and then by row.
    """

    coefficients: Value  # (terms, readings), with the offset taken off the constant term
    tangent: Value  # (d, hidden, rows) derivatives of the last hidden layer along d directions
    #: last layer (terms * channels, hidden + channels), whose last columns take the offset off
    layer: Value
    units: int  # hidden

    def slopes_at(self, basis: Value) -> Value:
        """Derivatives (d, channels, rows) of the channels along the directions, at one soil.

        The soil is given by its monomials (terms, 1). The derivatives are exact: each layer carries
        the tangents of its values.
        """
        units = self.units
        by_term = self.layer.reshape(-1, CHANNELS * (units + CHANNELS))
        at_soil = gemm(basis, by_term, transpose_a=True).reshape(CHANNELS, -1)
        return at_soil.split([units, CHANNELS], axis=1)[0] @ self.tangent


#: Points of the unknowns at which each design is simulated, for each term of the polynomial.
POINTS_PER_TERM = 2.5
SIMULATED_AT_A_TIME = 512  # Designs simulated at a time, which bounds the memory needed
#: Designs of a step of the training, and the share held out to measure the error.
BATCH, HELD_OUT = 256, 0.08
#: Least standard deviation to which an output is scaled: nearly constant coefficients are not
#: magnified.
LEAST_OUTPUT_STD = 2e-3
#: Weight of each channel's error in the loss; readings of sinkage have more noise.
CHANNEL_WEIGHTS = np.asarray([1.0, 0.4, 1.0])
#: The changes by another contact are needed to a tenth of their size: of fewer designs, one in
#: eight, and with fewer hidden units.
CONTACT_SHARE, LEAST_CONTACT_DESIGNS, CONTACT_HIDDEN = 8, 512, 32
#: Designs on which terms are chosen, and points of the unknowns.
SELECTION_DESIGNS, SELECTION_POINTS = 256, 512
CHECKED_DESIGNS = 128  # Simulated to see whether soils of the prior carry the loads
#: A design is learned from if this share of the soils of the prior carry its load: a polynomial
#: needs points on more than a corner of its range. This share of the designs must be such.
LEAST_CARRIED, LEAST_DESIGNS = 0.5, 0.5
#: Weight of a point without equilibrium, where the polynomial continues what is learned from the
#: others: it settles what these leave open, and does not change what they say.
CONTINUED_WEIGHT = 0.1


@dataclass(frozen=True)
class ResponseSettings:
    """Effort of the fit: designs simulated, width of the two hidden layers, epochs, seed.

    `scales` are those of the errors that a model trained so has, and `sensor_errors` are standard
    deviations of errors of its sensors, by input, where they are not the typical ones. The fit does
    not depend on them.
    """

    designs: int
    hidden: int
    epochs: int
    seed: int
    small: bool = False  # whether the file is for a microcontroller
    terms: int = 0  # most monomials; 0: all of the family's degrees
    scales: ErrorScales = USUAL_SCALES
    sensor_errors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Response:
    r"""Channels of a row as polynomials whose coefficients a small network computes.

    .. math:: y_k(d, x) = \sum_j a_{kj}(d)\, b_j(x)

    with b the monomials of the unknowns x, and a(d) a network with two tanh layers of the features
    of the design d. Rows of one soil have the same x: their log likelihoods add up, whatever their
    number and order.
    """

    terms: Terms
    scaling: Standardisation
    layers: tuple[Floats, ...]  # weights and biases in turn; the last gives (terms * channels)
    lower: Floats  # (f,) ends of the features of the designs
    upper: Floats
    error: Floats  # (channels,) rms over held-out designs, on the scales of the responses
    #: share of the pairs of a design and a soil that have an equilibrium, of which alone it learned
    carried: float = 1.0
    #: the changes of the channels with another contact, if this is an error of the family's model
    contact: Response | None = None

    def coefficients(self, features: Floats) -> Floats:
        """Coefficients (n, terms, channels) at features (n, f)."""
        found = evaluate_layers(self.layers, self.scaling.apply(features))
        return found.reshape(len(features), len(self.terms), -1)

    def predict(self, features: Floats, x: Floats) -> Floats:
        """Channels (n, m, channels) at features (n, f) and coordinates (n, m, p) or (m, p)."""
        return np.asarray(monomials(x, self.terms) @ self.coefficients(features))

    def add_at_soil(self, features: Value, basis: Value) -> Value:
        """Add the network to a graph, for channels (channels, rows) at the soil of monomials."""
        hidden = self._add_hidden(features, "contact")[-1][1]
        last, terms = np.concatenate([self.layers[-2], self.layers[-1][None]]), len(self.terms)
        by_channel = last.reshape(len(last), terms, CHANNELS).transpose(2, 0, 1).reshape(-1, terms)
        layer = constant(features.graph, by_channel, name="contact_last")
        at_soil = (layer @ basis).reshape(CHANNELS, -1)
        weights, bias = at_soil.split([len(last) - 1, 1], axis=1)
        return gemm(weights, hidden, bias)

    def add_to(self, features: Value, offset: Value, directions: Floats) -> ResponseValues:
        """Add the network to a graph, which can then have derivatives along directions (d, f).

        The offset (channels, rows) is subtracted from the channels.
        """
        graph, tangent = features.graph, constant(features.graph, directions[:, :, None])
        layers = self._add_hidden(features, "response")
        for weights, hidden in layers:
            tangent = (weights @ tangent) * (1.0 - hidden * hidden)
        terms, last = len(self.terms), self.layers[-2].T
        # the constant term is the first of each channel
        whole = np.concatenate([last, -np.eye(terms * CHANNELS, CHANNELS)], axis=1)
        layer = constant(graph, whole, name="response_last")
        bias = constant(graph, self.layers[-1][:, None], name="response_last_bias")
        output = gemm(layer, concat([layers[-1][1], offset], axis=0), bias)
        return ResponseValues(output.reshape(terms, -1), tangent, layer, last.shape[1])

    def _add_hidden(self, features: Value, name: str) -> list[tuple[Value, Value]]:
        """Weights (units, inputs) and values (units, rows) of all layers but the last.

        The first takes features without their mean, and scales them. Names of the constants are
        those by which `exported/stored_response.py` reads a file.
        """
        graph, layers = features.graph, []
        mean = constant(graph, self.scaling.mean[:, None], name=f"{name}_mean")
        hidden = features - mean
        for k, (weights, bias) in enumerate(
            zip(self.layers[:-2:2], self.layers[1:-2:2], strict=True)
        ):
            scale = self.scaling.scale if k == 0 else 1.0
            own = constant(graph, weights.T / scale, name=f"{name}_weights_{k}")
            of_layer = constant(graph, bias[:, None], name=f"{name}_bias_{k}")
            hidden = tanh(gemm(own, hidden, of_layer))
            layers.append((own, hidden))
        return layers


def fit_response(family: WheelFamily, settings: ResponseSettings, progress: Progress) -> Response:
    """The response surface of a family, with that of the changes by another contact if it has one.

    Designs and soils are drawn together: pairs without an equilibrium take no part. Raises
    `InputError`, before anything is fitted, for loads that most soils of the prior do not carry.
    """
    check_equilibria(family, settings.seed)
    terms = family_terms(family)
    if 0 < settings.terms < len(terms):
        terms = _most_useful_terms(family, terms, settings)
    response = _fit(family, family.responses, terms, settings, progress)
    if family.model_errors()["contact"] == 0.0:
        return response
    designs = max(LEAST_CONTACT_DESIGNS, settings.designs // CONTACT_SHARE)
    hidden = settings.hidden // 2 if settings.small else min(settings.hidden, CONTACT_HIDDEN)
    smaller = replace(settings, designs=designs, hidden=hidden)
    return replace(response, contact=_fit(family, family.contact_changes, terms, smaller, progress))


def carried_shares(family: WheelFamily, seed: int) -> tuple[Floats, Floats]:
    """A few designs (n, d), and the share of the soils of the prior that carry each, (n,)."""
    designs = family.designs(CHECKED_DESIGNS, seed)
    x = prior_points(family.axes, family.free, SELECTION_POINTS, seed)
    return designs, np.isfinite(family.responses(designs, x[None])).all(axis=2).mean(axis=1)


def check_equilibria(family: WheelFamily, seed: int) -> None:
    """Raise `InputError` for loads that most soils of the prior do not carry; takes seconds."""
    carried = float(np.mean(carried_shares(family, seed)[1] >= LEAST_CARRIED))
    if carried < LEAST_DESIGNS:
        raise InputError(
            f"{family.described()}: only {carried:.0%} of these slips and loads have an "
            "equilibrium on half of these soils; needed is half of them: lower the loads, or "
            "raise the bearing values or the lower ends of their priors"
        )


def family_terms(family: WheelFamily) -> Terms:
    """All monomials of the degrees of a family."""
    return monomial_terms(len(family.axes), family.degree[0], family.targets, family.degree[1])


def _most_useful_terms(family: WheelFamily, terms: Terms, settings: ResponseSettings) -> Terms:
    """So many of these terms as the settings permit, chosen on a few designs."""
    x = prior_points(family.axes, family.free, SELECTION_POINTS, settings.seed)
    y = family.responses(family.designs(SELECTION_DESIGNS, settings.seed), x[None])
    carried = np.isfinite(y).all(axis=2).mean(axis=1)
    y = np.stack([_continued(one, x) for one in y[carried >= LEAST_CARRIED]]) * CHANNEL_WEIGHTS
    return select_terms(x, y.swapaxes(0, 1).reshape(len(x), -1), terms, settings.terms)


def _fit(
    family: WheelFamily,
    respond: Callable[[Floats, Floats], Floats],
    terms: Terms,
    settings: ResponseSettings,
    progress: Progress,
) -> Response:
    """A surface of channels (n, m, 3) in these terms, fitted to simulated designs.

    Each design is simulated at points of the unknowns, and a polynomial is fitted to its responses;
    a network then learns the coefficients of the polynomials from the features of the designs.
    """
    x = prior_points(family.axes, family.free, int(POINTS_PER_TERM * len(terms)), settings.seed)
    basis = monomials(x, terms)
    designs = family.designs(settings.designs, settings.seed)
    coefficients, squared_error, carried = _fit_polynomials(respond, designs, x, basis, progress)
    used = carried.mean(axis=1) >= LEAST_CARRIED
    features = family.features(designs[used])
    # the error of a coefficient counts by the rms of its monomial
    error_weights = np.sqrt(np.mean(basis**2, axis=0))[:, None] * CHANNEL_WEIGHTS
    response = _train_network(
        terms, features, coefficients, error_weights, settings=settings, progress=progress
    )
    held_out = slice(0, int(HELD_OUT * len(features)))
    network_error = basis @ (response.coefficients(features[held_out]) - coefficients[held_out])
    network_error = network_error[carried[used][held_out]]
    # residuals of a least-squares fit are too small by the degrees of freedom of the fit
    fit_error = squared_error[held_out] * len(x) / (len(x) - len(terms))
    error = np.sqrt(np.mean(network_error**2, axis=0) + fit_error.mean(axis=0))
    return replace(response, error=error, carried=float(carried.mean()))


def _fit_polynomials(
    respond: Callable[[Floats, Floats], Floats],
    designs: Floats,
    x: Floats,
    basis: Floats,
    progress: Progress,
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Least-squares polynomials of designs at points x (m, p), whose monomials are the basis.

    Coefficients (used, terms, channels), mean squared residuals (used, channels), of the designs
    that are learned from; and which points carry each design, (n, m).
    """
    fit = partial(_fit_some, respond, x, basis, np.asarray(np.linalg.pinv(basis)))
    parts = [
        designs[first : first + SIMULATED_AT_A_TIME]
        for first in range(0, len(designs), SIMULATED_AT_A_TIME)
    ]
    found = []
    with process_map(fit, parts) as results:
        for done, result in enumerate(results):
            progress("simulating", done * SIMULATED_AT_A_TIME, len(designs))
            found.append(result)
    progress("simulating", len(designs), len(designs))
    coefficients, squared_error, carried = zip(*found, strict=True)
    return (np.concatenate(coefficients), np.concatenate(squared_error), np.concatenate(carried))


def _fit_some(
    respond: Callable[[Floats, Floats], Floats],
    x: Floats,
    basis: Floats,
    pseudo_inverse: Floats,
    designs: Floats,
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The result of `_fit_polynomials` for some of the designs, in one worker."""
    y = respond(designs, x[None])
    carried = np.asarray(np.isfinite(y).all(axis=2))
    whole = np.asarray(carried.all(axis=1))
    used = carried.mean(axis=1) >= LEAST_CARRIED
    y = y[used]
    a = np.empty((len(y), basis.shape[1], y.shape[2]))
    a[whole[used]] = (y[whole[used]].swapaxes(1, 2) @ pseudo_inverse.T).swapaxes(1, 2)
    for i in np.flatnonzero(~whole[used]):
        weight = np.where(np.isfinite(y[i]).all(axis=1), 1.0, CONTINUED_WEIGHT)[:, None]
        a[i] = np.linalg.lstsq(weight * basis, weight * _continued(y[i], x), rcond=None)[0]
    squared = np.where(carried[used][:, :, None], (basis @ a - y) ** 2, np.nan)
    return a, np.nanmean(squared, axis=1), carried


def _continued(y: Floats, x: Floats) -> Floats:
    """Channels (m, channels) of a design, continued linearly to points x without an equilibrium.

    The values stay between the least and the largest of the other points.
    """
    carried = np.asarray(np.isfinite(y).all(axis=1))
    if carried.all():
        return y
    basis = np.concatenate([np.ones_like(x[:, :1]), x], axis=1)
    found = np.linalg.lstsq(basis[carried], y[carried], rcond=None)[0]
    ends = y[carried].min(axis=0), y[carried].max(axis=0)
    return np.where(carried[:, None], y, np.clip(basis @ found, *ends))


def _train_network(
    terms: Terms,
    features: Floats,
    coefficients: Floats,
    error_weights: Floats,
    settings: ResponseSettings,
    progress: Progress,
) -> Response:
    """Train the network on all but the held-out designs: Adam with a one-cycle learning rate.

    The loss is the squared error of coefficients times their weights (terms, channels).
    """
    rng = np.random.default_rng(settings.seed)
    start = int(HELD_OUT * len(features))
    scaling = Standardisation.of(features)
    y = (coefficients * error_weights).reshape(len(coefficients), -1)
    y_mean = y.mean(axis=0)
    y_std = np.maximum(y.std(axis=0), LEAST_OUTPUT_STD)
    x_train = scaling.apply(features[start:]).astype(np.float32)
    y_train = (y[start:] - y_mean).astype(np.float32)
    output_scale = y_std.astype(np.float32)
    network = TanhNetwork([features.shape[1], settings.hidden, settings.hidden, y.shape[1]], rng)
    batches = max(len(x_train) // BATCH, 1)
    with threadpool_limits(1):  # sums in a fixed order, whatever the number of cores
        for epoch in range(settings.epochs):
            progress("training the response surface", epoch, settings.epochs)
            order = rng.permutation(len(x_train))
            for batch in range(batches):
                rows = order[batch * BATCH : (batch + 1) * BATCH]
                error = network.forward(x_train[rows]) * output_scale
                error -= y_train[rows]
                error *= output_scale * (2.0 / len(rows))
                network.backward(error)
                step = epoch * batches + batch
                network.step(one_cycle_rate(step / (settings.epochs * batches)))
    progress("training the response surface", settings.epochs, settings.epochs)
    arrays = network.layers()
    # the last layer takes over the scaling of the outputs
    flat = error_weights.reshape(-1)
    arrays[-2] = arrays[-2] * y_std / flat
    arrays[-1] = (arrays[-1] * y_std + y_mean) / flat
    ends = features.min(axis=0), features.max(axis=0)
    return Response(terms, scaling, tuple(arrays), *ends, np.zeros(len(RESPONSE_CHANNELS)))
