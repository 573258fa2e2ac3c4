"""Worlds of a recipe: runs in which an effect that the model lacks acts, or a smooth error.

A recipe without [worlds] draws all runs from its model, as if that were right. A file trained on
such rows is certain of what holds in that model alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy, range_with_zero
from soilml.errors import InputError
from soilml.fitting.candidate_effects import candidate_effects, with_effect
from soilml.io.toml_settings import Settings
from soilml.numerics.smooth_process import SmoothFunctions, process_columns, slip_load_points
from soilml.parameters import declared, mapped
from soilml.physics.contact import Force
from soilml.physics.effects import Effect
from soilml.physics.operating_point import COVARIATES, FROM_ORDER, Operating
from soilml.quantities import CHANNELS, column

#: Share of the runs in which one effect acts, and share in which the model has a smooth error.
EFFECT_SHARE, ERROR_SHARE = 0.4, 0.5
#: An error of a model is usually this share of the range of a channel.
USUAL_ERROR = Discrepancy(share=0.02)
#: Slips and loads at which the ranges of the channels are measured, a side of their grid.
GRID = 8
#: Last numbers of the seeds of the random streams.
WHICH_EFFECT, SIZE, HAS_ERROR, WEIGHTS = 11, 12, 13, 14


@dataclass(frozen=True)
class Worlds:
    r"""What may act in a run beside the model, each in a share of the runs, independently.

    effect: Share of runs in which one effect acts, which of them being equally likely. Its size is
        uniform from 0 to twice the reference size of the catalogue, or normal with the standard
        deviation of a checked setup for sensors and rigs.
    effects: The effects, by name.
    error: Share of runs with a smooth error in each channel: a Gaussian process of slip and log
        load (Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2).
    amplitudes: That process by column: its standard deviation as `constant`, and its lengths.
    """

    effect: float
    effects: Mapping[str, type[Effect]]
    error: float
    amplitudes: Mapping[str, Discrepancy]

    def forces(
        self, case: Case, at: Operating, seed: tuple[int, ...], run: NDArray[np.int64]
    ) -> Force:
        """Forces of all rows (n,), each with the effect of its run; of one gear."""
        drawn = uniform_by_index((*seed, WHICH_EFFECT), run)
        ends = self.effect * np.arange(1, len(self.effects) + 1) / max(len(self.effects), 1)
        number = np.searchsorted(ends, drawn, side="right")  # the last one: no effect
        normal, uniform = normal_by_index((*seed, SIZE), run), uniform_by_index((*seed, SIZE), run)
        parts: dict[str, Any] = {}
        for i in np.unique(number):
            own = np.flatnonzero(number == i)
            of_rows = mapped(case, partial(_cut, own))
            if i < len(self.effects):
                effect = list(self.effects.values())[i]
                size = _sizes(effect, normal[own], uniform[own])
                changed = with_effect(of_rows, effect)
                of_rows = changed.with_values({f"{effect.name}.{effect.about.size}": size})
            force = of_rows.model(of_rows.soil, mapped(at, partial(_cut, own)))
            for field in fields(Force):
                value = np.broadcast_to(np.asarray(getattr(force, field.name)), own.shape)
                whole = parts.setdefault(field.name, np.empty(len(run), value.dtype))
                whole[own] = value
        found = Force(**parts)
        if case.remainder is not None:
            found = case.remainder.added_to(found, at.slip, at.load)
        return found

    def errors(
        self,
        driven: tuple[tuple[float, float], tuple[float, float]],
        at: Operating,
        seed: tuple[int, ...],
        run: NDArray[np.int64],
    ) -> dict[str, Floats]:
        """The smooth error (n,) of each column; zero in runs that have none."""
        present = uniform_by_index((*seed, HAS_ERROR), run) < self.error
        found = {}
        for i, (name, kind) in enumerate(self.amplitudes.items()):
            error = smooth_error(process_functions(kind, driven), (*seed, i, WEIGHTS), at, run)
            found[name] = present * error
        return found


def process_functions(
    kind: Discrepancy, driven: tuple[tuple[float, float], tuple[float, float]]
) -> SmoothFunctions:
    """The absolute part of a discrepancy as functions of slip and load (N) in these ranges."""
    lengths = kind.slip_length, kind.log_load_length

    def columns(slip: Floats, load: Floats) -> Floats:
        return process_columns(slip_load_points(slip, load, *lengths), kind.constant)

    return SmoothFunctions.of(columns, lengths, *driven)


def smooth_error(
    functions: SmoothFunctions, seed: tuple[int, ...], at: Operating, run: NDArray[np.int64]
) -> Floats:
    r"""An error (n,) that is a smooth function of slip and load, one draw for each run.

    .. math:: \delta_r(s, W) = \sum_j w_{rj} \phi_j(s, \ln W), \quad w_{rj} \sim N(0, 1)

    References: Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2.
    """
    first, last = int(run[0]), int(run[-1]) + 1
    index = np.arange(first * functions.count, last * functions.count)
    weights = normal_by_index(seed, index).reshape(-1, functions.count)[run - first]
    return np.asarray(
        (functions.at(np.asarray(at.slip), np.asarray(at.load)) * weights).sum(axis=1)
    )


def take_worlds(
    settings: Settings,
    case: Case,
    driven: tuple[tuple[float, float], tuple[float, float]],
    known: Mapping[str, type[Effect]],
    given: frozenset[str],
) -> Worlds:
    """Read the table [worlds].

    driven: Ranges of slip and load (N).
    known: Effects of the catalogue.
    given: Covariates that the recipe varies.

    Raises `InputError` for shares outside 0 to 1, and for an effect that is unknown, does not suit
    the gear, or needs a column that the recipe lacks.
    """
    shares = [
        settings.number(key, usual)
        for key, usual in (("effect", EFFECT_SHARE), ("error", ERROR_SHARE))
    ]
    for key, share in zip(("effect", "error"), shares, strict=True):
        if not 0.0 <= share <= 1.0:
            settings.fail(f"{key} is {share:g}; needed is a share of the runs from 0 to 1")
    suited = candidate_effects(case, known)
    own = {effect.name for effect in case.model.effects}
    possible = {  # effects that act on rows without an order, with these covariates
        name: effect
        for name, effect in suited.items()
        if name not in own
        and set(effect.about.needs) <= given
        and not {*effect.about.needs, *effect.about.uses} & FROM_ORDER.keys()
    }
    names = settings.take("effects", list, "a list of names of effects", list(possible))
    for name in names:
        if name not in possible:
            lacking = suited.get(name)
            columns = [COVARIATES[field] for field in lacking.about.needs] if lacking else []
            hint = f"needs {', '.join(columns)} in [operating]" if columns else "is none that suits"
            settings.fail(f"effects has {name!r}, which {hint}; there are: {', '.join(possible)}")
    settings.finish()
    if shares[0] > 0.0 and not names:
        settings.fail("no effect is left that can act; give effect = 0.0")
    ranges = _channel_ranges(case, driven)
    errors = {key: case.discrepancy.get(key, USUAL_ERROR) for key in map(column, CHANNELS)}
    amplitudes = {k: replace(e, constant=e.amplitude(ranges[k])) for k, e in errors.items()}
    return Worlds(shares[0], {name: possible[name] for name in names}, shares[1], amplitudes)


def _sizes(effect: type[Effect], normal: Floats, uniform: Floats) -> Floats:
    """Sizes (n,) of an effect, in the unit of its size and inside its range."""
    about, parameter = effect.about, declared(effect)[effect.about.size]
    if about.calibration is not None:
        size = about.calibration * normal
    else:
        size = 2.0 * about.reference[about.size] * uniform
    return np.asarray(np.clip(size, parameter.lower, parameter.upper))


def _cut(own: NDArray[np.intp], value: Any) -> Any:
    """Some of the rows of a value that differs between them."""
    return value[own] if np.ndim(value) else value


def _channel_ranges(
    case: Case, driven: tuple[tuple[float, float], tuple[float, float]]
) -> dict[str, float]:
    """Range of each channel, with zero, over slips and loads by the model as it is; by column."""
    slip, load = (np.linspace(*ends, GRID) for ends in driven)
    at = Operating(slip=np.repeat(slip, GRID), load=np.tile(load, GRID))
    plain = replace(case, model=replace(case.model, effects=()))
    force = plain.model(plain.soil, at)
    ranges = {column(n): range_with_zero(np.asarray(getattr(force, n))) for n in CHANNELS}
    if not all(ranges.values()):
        raise InputError(
            "[worlds]: the soil of [soil] carries no load of [operating], so that the size of a "
            "model's error is not known; give a soil that does"
        )
    return ranges


def uniform_by_index(seed: tuple[int, ...], index: NDArray[np.int64]) -> Floats:
    """Uniform numbers (n,) in 0 to 1 by ascending index (n,), from a counter-based generator."""
    first, last = int(index[0]), int(index[-1]) + 1
    start = first - first % 4  # Philox generates four words at a time
    generator = np.random.Philox(np.random.SeedSequence(seed))
    generator.advance(start // 4)
    uniform = np.random.Generator(generator).random(last - start)[first - start :]
    return np.asarray(uniform[index - first])


def normal_by_index(seed: tuple[int, ...], index: NDArray[np.int64]) -> Floats:
    """Standard normal numbers (n,) by ascending index (n,)."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.clip(uniform_by_index(seed, index), 1e-16, 1.0 - 1e-16)))
