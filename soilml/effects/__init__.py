"""The catalogue of effects: a new effect is one new file and one line here."""

from soilml.effects.base import Effect, EffectCard
from soilml.effects.bulldozing import Bulldozing
from soilml.effects.exit_angle import ExitAngle
from soilml.effects.grousers import Grousers
from soilml.effects.slip_sinkage import SlipSinkage

#: Effect by the name that `[[effect]] name` takes in a model file.
EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        SlipSinkage,
        Grousers,
        ExitAngle,
        Bulldozing,
    )
}

__all__ = ["EFFECTS", "Bulldozing", "Effect", "EffectCard", "ExitAngle", "Grousers", "SlipSinkage"]
