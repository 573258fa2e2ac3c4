"""A training spec: what to learn, from what, with which regressors."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

from datagen.recipe import packaged_file
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.estimate_fusion import RULES
from soilml.onboard.features import inputs_of
from soilml.quantities import SHEAR
from training.data.targets import PER_ROW, check_targets
from training.regressors.feature_subset import FeatureSubset
from training.regressors.fixed_size_lssvm import FixedSizeLSSVM
from training.regressors.gaussian_mlp import GaussianMLP
from training.regressors.linear_gaussian import LinearGaussian
from training.regressors.lssvm import LSSVM
from training.set_posterior.response_surface import ResponseSettings
from training.set_posterior.settings import take_response_settings

#: Regressor by the name that `[[regressor]] type` takes: one new file and one line here.
REGRESSORS: dict[str, type] = {
    cls.kind: cls
    for cls in (
        LSSVM,
        FixedSizeLSSVM,
        GaussianMLP,
        LinearGaussian,
    )
}

#: What a seed must be, for the generators of all libraries.
SEED = "a whole number from 0 to 2^32 - 1"


@dataclass(frozen=True)
class Spec:
    """Seed, features, targets, regressors (unfitted) and the rule that joins them."""

    name: str
    seed: int
    features: tuple[str, ...]
    targets: tuple[str, ...]
    regressors: tuple[FeatureSubset, ...]
    rule: str
    text: str
    set_posterior: ResponseSettings | None = None

    @property
    def per_row(self) -> bool:
        """Whether a target differs from row to row of a run."""
        return any(name in PER_ROW for name in self.targets)


def read_spec(path: str | os.PathLike[str]) -> Spec:
    """The spec in a TOML file, or a packaged one by name; raises `InputError` naming the key."""
    file = packaged_file(path, "training", "specs")
    settings = read_settings(file)
    features = _words(settings, "features", ["slip", "torque/load", "load"])
    inputs_of(features)  # names the first that cannot be read
    targets = _words(settings, "targets", list(SHEAR))
    try:
        check_targets(targets, features)
    except InputError as error:
        settings.fail(str(error))
    seed = int(settings.take("seed", int, SEED, 0))
    if not 0 <= seed < 2**32:
        settings.fail(f"seed is {seed}; needed is {SEED}")
    rule = settings.text("rule", "best-linear")
    if rule not in RULES:
        settings.fail(f"rule is {rule!r}; there are: {', '.join(RULES)}")
    regressors: list[FeatureSubset] = []
    for entry in settings.tables("regressor"):
        regressors.append(_reader(entry, seed, features, [r.kind for r in regressors]))
    if not regressors:
        settings.fail("[[regressor]] is missing; give one or more")
    read = {k for r in regressors for k in r.columns or range(len(features))}
    for k in set(range(len(features))) - read:
        settings.fail(f"features: no regressor reads {features[k]!r}; leave it out")
    size = take_response_settings(settings, seed) if "set_posterior" in settings else None
    settings.finish()
    return Spec(
        name=file.stem,
        seed=seed,
        features=tuple(features),
        targets=tuple(targets),
        regressors=tuple(regressors),
        rule=rule,
        text=json.dumps(settings.content, sort_keys=True),
        set_posterior=size,
    )


def _words(settings: Settings, key: str, default: list[str]) -> list[str]:
    words = settings.take(key, list, "a list of names", default)
    if not words or not all(isinstance(word, str) for word in words):
        settings.fail(f"{key} is {words!r}; needed is a list of names")
    if len(set(words)) < len(words):
        settings.fail(f"{key} is {words!r}; a name stands twice")
    return [str(word) for word in words]


def _reader(settings: Settings, seed: int, features: list[str], taken: list[str]) -> FeatureSubset:
    """A regressor and what it reads; two that would have one name are numbered."""
    own = _words(settings, "features", features)
    for name in own:
        if name not in features:
            settings.fail(f"features: {name!r} is none of the spec's: {', '.join(features)}")
    machine = _machine(settings, seed)
    kind, columns = machine.kind, None
    if own != features:
        kind, columns = f"{kind} of {', '.join(own)}", tuple(features.index(name) for name in own)
    alike = sum(name == kind or name.startswith(f"{kind} #") for name in taken)
    return FeatureSubset(f"{kind} #{alike + 1}" if alike else kind, machine, columns)


def _machine(settings: Settings, seed: int) -> Any:
    kind = settings.text("type")
    if kind not in REGRESSORS:
        settings.fail(f"type is {kind!r}; there are: {', '.join(REGRESSORS)}")
    made = REGRESSORS[kind]()
    allowed = made.get_params()
    settings.knows(allowed)
    given: dict[str, Any] = {}
    for key, default in allowed.items():
        if key not in settings:
            continue
        if isinstance(default, tuple | list):
            given[key] = tuple(settings.take(key, list, "a list of whole numbers"))
            if not all(type(v) is int and 1 <= v <= 4096 for v in given[key]):
                settings.fail(f"{key} is {list(given[key])}; needed are whole numbers above zero")
        elif isinstance(default, int):
            given[key] = settings.count(key)
        else:
            given[key] = settings.number(key)
            if not 1e-12 <= given[key] <= 1e12:
                settings.fail(
                    f"{key} is {given[key]:g}; needed is a number above zero, 1e-12 to 1e12"
                )
    settings.finish()
    if "random_state" in allowed and "random_state" not in given:
        given["random_state"] = seed
    return made.set_params(**given)
