"""Blind sets: simulated runs with mechanisms that are not in the model given to the analyst.

The wheel and the mechanisms are an independent implementation, which imports nothing of soilml, so
that an error in the analysis cannot hide in the data that test it.

`reference_wheel` has the wheel and the stages at which a mechanism acts; `catalogued` and
`uncatalogued` have the mechanisms, `law_families` other laws of the soil and soils that change;
`soil_families` has soils and wheels, and what the analyst is given of them, right or wrong;
`run_schedules` the operating points;
`reading_errors` what readings have beside the forces, by place (smooth discrepancies), by time
(autocorrelation) and by chance; `plans` the tiers and the sets to simulate; `blind_set` the set of
a plan, and its truth.
"""

from datagen.blind_sets.blind_set import BlindSet, csv_text, draw_blind_set, write_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from datagen.blind_sets.reference_wheel import MECHANISMS

__all__ = [
    "MECHANISMS",
    "BlindSet",
    "Plan",
    "benchmark_plans",
    "csv_text",
    "draw_blind_set",
    "write_blind_set",
]
