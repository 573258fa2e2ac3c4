"""Draws of what a design may meet: a soil, and an error of the model as large as is typical."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case, read_case
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import InputError
from soilml.fitting.coordinates import select_free
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS, ModelledErrors, without_errors
from soilml.io.read_table import RUNS, read_table
from soilml.numerics.prior import Prior
from soilml.numerics.quantiles import latin_hypercube
from soilml.numerics.smooth_process import SmoothFunctions, process_columns, slip_load_points
from soilml.parameters import declared, mapped
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.effects.grousers import Grousers
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.soils import Soil
from soilml.remarks import Remark
from soilml.rover_design.study import SoilQuestion
from soilml.traction.soil_draws import MeasuredSoil, measured_soil, prior_draws

#: Probability that the model is exact: a model is never quite right. Those of errors of all kinds
#: together, by their scale over the typical ones.
EXACT, ERRORS = 0.06, {0.1: 0.14, 0.25: 0.14, 0.5: 0.16, 1.0: 0.2, 2.0: 0.02}
#: Probability that one effect of the catalogue is missing, by the scale of errors beside it, and
#: the standard deviations of its size, in reference sizes, each as likely.
EFFECT, SIZES = {0.0: 0.1, 0.25: 0.1}, (1.0, 3.0)
#: Probability that a law of the soil is a little different, by one of these effects, and the
#: standard deviation of its size, in reference sizes.
LAW, LAW_SIZE = 0.08, 0.4
LAWS = ("shear-softening", "hyperbolic-shear", "curved-envelope")
#: Amplitude of a typical smooth error as a share of the range of readings, and standard deviations
#: to which the size of an effect is drawn.
SMOOTH, REACH = 0.02, 4.0
#: Range of lambda, the share of a lug's height by which the soil shears further out (Ding et al.
#: 2011).
LUG_SHEARING = (0.5, 1.0)
#: Loads over the mean load of the wheels between which the smooth error is defined.
LOADS = (0.2, 5.0)
#: What is known of a rover's drive; effects that need anything else are left out.
KNOWN_OF_A_ROVER = {"pass_number", "slip_angle"}


@dataclass(frozen=True)
class DrawnWorlds:
    """n draws of a soil, and of the error of the model beside each.

    soil: Parameters (n,) in SI units by name.
    kind: Number (n,) of the published soil that each is, in `kinds`.
    errors: Errors (n,) by the names of `USUAL_MODEL_ERRORS`.
    scale: Size (n,) of all errors over the typical ones.
    lacking: Effects that the plain model lacks, with parameters (n,).
    acts: Which of them act in each draw, (n, effects).
    lug_shearing: Lambda of `grousers`, (n,).
    smooth: Functions of slip and of load over the mean load of the wheels, for a smooth error.
    weights: Weights (n, 2, q) of these functions, of drawbar pull and of torque.
    remarks: What limits the draws.
    """

    soil: Mapping[str, Floats]
    kind: NDArray[np.int64]
    kinds: tuple[str, ...]
    errors: Mapping[str, Floats]
    scale: Floats
    lacking: tuple[Effect, ...]
    acts: NDArray[np.bool_]
    lug_shearing: Floats
    smooth: SmoothFunctions
    weights: Floats
    remarks: tuple[Remark, ...]

    @property
    def count(self) -> int:
        """Number of draws, n."""
        return len(self.scale)

    def groups(self) -> list[NDArray[np.int64]]:
        """Draws (g,) that share one form of the model, by the effects that act."""
        _, which = np.unique(self.acts, axis=0, return_inverse=True)
        return [np.flatnonzero(np.ravel(which) == i) for i in range(int(which.max()) + 1)]

    def effects(self, draw: NDArray[np.int64], mean_load: Floats) -> list[Effect]:
        """The effects (k,) by which these draws (k,), of one group, differ from the plain model.

        mean_load: Mean load of the wheels of each, N (k,).
        """
        solved = [n for n in declared(ModelledErrors) if n in self.errors]
        values = {n: self.errors[n][draw] for n in solved}
        own = [e for e, acts in zip(self.lacking, self.acts[draw[0]], strict=True) if acts]
        return [
            ModelledErrors(**values, typical_load=mean_load),
            *(mapped(e, lambda v: v[draw] if np.ndim(v) else v) for e in own),
        ]

    def of_soil(self, draw: NDArray[np.int64]) -> Soil:
        """The soils (k,) of these draws (k,)."""
        return Soil(**{name: values[draw] for name, values in self.soil.items()})


def draw_worlds(
    question: SoilQuestion,
    count: int,
    slip_limit: float,
    seed: int = 0,
    rows: MeasuredSoil | None = None,
) -> DrawnWorlds:
    r"""Draws of the soil and of the model's errors, before any test of the design.

    The errors are what a model may lack before any row is seen: nothing, typical errors of several
    scales with a smooth error of slip and load, another law of the soil, an effect of the
    catalogue. Errors of sensors are none of a rover's. A
    published soil keeps to the ranges that its paper prints, and each of several is as likely.

    question: The soils.
    count: Number of draws, n.
    slip_limit: Highest slip at which errors are asked for.
    rows: What `soil_of_rows` gives for the question.
    """
    rng = np.random.default_rng(seed)
    if rows is None:
        soil, kind, kinds, free, remarks = _soils(question, count, rng)
        scale, lacking, acts = _hypotheses(count, rng)
    else:
        kind, kinds = np.zeros(count, np.int64), (question.files[-1],)
        soil, free, lacking, acts = _of_rows(rows, count, rng)
        scale, remarks = _hypotheses(count, rng, effects=False)[0], list(rows.warnings)
    names = [n for n in USUAL_MODEL_ERRORS if n not in without_errors(free, (), [_WHEEL])]
    normal = _stratified_normal(count, len(names), rng)
    errors = {n: USUAL_MODEL_ERRORS[n] * scale * normal[:, i] for i, n in enumerate(names)}
    lengths = Discrepancy().slip_length, Discrepancy().log_load_length

    def unit(slip: Floats, load: Floats) -> Floats:
        return process_columns(slip_load_points(slip, load, *lengths))

    smooth = SmoothFunctions.of(unit, lengths, (0.0, slip_limit), LOADS)
    weights = SMOOTH * scale[:, None, None] * rng.standard_normal((count, 2, smooth.count))
    lug = Prior(*LUG_SHEARING).at(latin_hypercube(count, 1, rng)[:, 0])
    return DrawnWorlds(
        soil, kind, kinds, errors, scale, lacking, acts, lug, smooth, weights, tuple(remarks)
    )


_WHEEL = Wheel(radius=0.1, width=0.1)


def _soils(
    question: SoilQuestion, count: int, rng: np.random.Generator
) -> tuple[dict[str, Floats], NDArray[np.int64], tuple[str, ...], list[str], list[Remark]]:
    """Parameters (n,), kinds (n,) and their names, parameters that vary, remarks."""
    own = {name: entry.soil for name, entry in question.entries.items()}
    if question.soil is not None:
        own = {"the soil of the file": question.soil}
    kind = rng.permutation(np.arange(count) % len(own)).astype(np.int64)
    values = {name: np.empty(count) for name in declared(Soil)}
    varied: list[str] = []
    remarks = []
    for number, (name, base) in enumerate(own.items()):
        entry = question.entries.get(name)
        spread = {} if entry is None else {k: Prior(*ends) for k, ends in entry.spread.items()}
        prior = {**spread, **question.prior}
        of_kind = np.flatnonzero(kind == number)
        for key in values:
            values[key][of_kind] = getattr(base, key)
        if prior:
            case = Case(Model(_WHEEL), base, prior=dict(prior), soil_tests=question.tests)
            draws = prior_draws(select_free(case, None), of_kind.size, case)
            for i, path in enumerate(draws.names):
                values[path][of_kind] = draws.values[:, i]
        varied += prior.keys()
        missing = [] if entry is None else [k for k in entry.assumed if k not in prior]
        if missing:
            text = f"{name} prints no {', '.join(missing)}: assumed; give ranges in [soil.prior]"
            remarks.append(Remark("assumed-soil", text, (name, *missing)))
    if len(own) == 1 and not varied:
        text = "the soil is taken at its stated values, without a spread: give [soil.prior]"
        remarks.append(Remark("no-spread", text, tuple(own)))
    common = [name for name in dict.fromkeys(varied) if varied.count(name) == len(own)]
    return values, kind, tuple(own), common, remarks


def soil_of_rows(question: SoilQuestion) -> MeasuredSoil | None:
    """The posterior of the rows that a question names; None for one without rows.

    Raises `InputError` for a model file of several gears, and as `identify`.
    """
    if question.rows is None:
        return None
    model, runs = question.rows
    case = read_case(model, with_bias=True, with_explanations=True)
    if case.gears:
        raise InputError(f"{model} has several gears; needed is one with [gear]")
    return measured_soil(replace(case, rover=None), read_table(runs, RUNS))


def _of_rows(
    rows: MeasuredSoil, count: int, rng: np.random.Generator
) -> tuple[dict[str, Floats], list[str], tuple[Effect, ...], NDArray[np.bool_]]:
    """Soil, parameters of it that vary, and effects with the draws in which they act.

    Effects of rig and sensors, and those that need what is not known of a rover, are left out.
    """
    index = rng.permutation(np.arange(count) % len(rows.draws.values))
    drawn = dict(zip(rows.draws.names, rows.draws.values[index].T, strict=True))
    soil = {
        key: drawn.get(key, np.full(count, float(getattr(rows.case.soil, key))))
        for key in declared(Soil)
    }
    effects, acts = [], []
    for effect in rows.case.model.effects:
        if not _acts_on_a_rover(type(effect)):
            continue
        fixed = {key: float(getattr(effect, key)) for key in declared(type(effect))}
        own = {
            key: drawn.get(f"{effect.name}.{key}", np.full(count, value))
            for key, value in fixed.items()
        }
        effects.append(replace(effect, **own))
        acts.append(own[effect.about.size] != getattr(type(effect)(), effect.about.size))
    varied = [key for key in drawn if key in soil]
    return soil, varied, tuple(effects), np.reshape(acts, (len(effects), count)).T


def _hypotheses(
    count: int, rng: np.random.Generator, *, effects: bool = True
) -> tuple[Floats, tuple[Effect, ...], NDArray[np.bool_]]:
    """Scale (n,) of the errors, and missing effects with the draws in which they act."""
    candidates = [n for n, e in EFFECTS.items() if e.applies_to(_WHEEL) and e is not Grousers]
    options = [(EXACT, 0.0, "", 0.0), *((p, s, "", 0.0) for s, p in ERRORS.items())]
    if effects:
        options += [(LAW / len(LAWS), 0.0, name, LAW_SIZE) for name in LAWS]
        for scale, prior in EFFECT.items():
            share = prior / (len(candidates) * len(SIZES))
            options += [(share, scale, name, std) for name in candidates for std in SIZES]
    ends = np.cumsum([o[0] for o in options])
    chosen = np.searchsorted(ends / ends[-1], latin_hypercube(count, 1, rng)[:, 0], side="right")
    fraction = rng.random(count)
    sizes: dict[str, Floats] = {}
    for number in np.unique(chosen):
        _, _, name, std = options[number]
        if not name or not _acts_on_a_rover(EFFECTS[name]):
            continue
        about = EFFECTS[name].about
        bounds, std = declared(EFFECTS[name])[about.size], std * abs(about.reference[about.size])
        ends_of_size = max(bounds.lower, -REACH * std), min(bounds.upper, REACH * std)
        rows = np.flatnonzero(chosen == number)
        sizes.setdefault(name, np.full(count, np.nan))[rows] = Prior(
            *ends_of_size, normal_std=std
        ).at(fraction[rows])
    acts = np.isfinite(np.reshape(list(sizes.values()), (len(sizes), count))).T
    lacking = (
        EFFECTS[name](**{EFFECTS[name].about.size: np.nan_to_num(own)})
        for name, own in sizes.items()
    )
    return np.asarray([o[1] for o in options])[chosen], tuple(lacking), acts


def _acts_on_a_rover(effect: type[Effect]) -> bool:
    """Whether an effect is none of rig or sensors, and needs only what is known of a rover."""
    return effect.about.kind in ("soil", "wheel") and set(effect.about.needs) <= KNOWN_OF_A_ROVER


def _stratified_normal(count: int, columns: int, rng: np.random.Generator) -> Floats:
    """Standard normal values (n, columns), stratified in each column."""
    unit = Prior.normal(1.0)
    parts = [unit.at(latin_hypercube(count, 1, rng)[:, 0]) for _ in range(columns)]
    return np.stack(parts, axis=1) if parts else np.zeros((count, 0))
