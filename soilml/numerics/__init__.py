"""Numerical methods without soil mechanics: roots, quadrature, sampling."""

from soilml.numerics.maximum_entropy import moment_matched_weights, prior_quantiles
from soilml.numerics.prior import Prior
from soilml.numerics.quadrature import Nodes, columns, crowded_ends, crowded_start, gauss
from soilml.numerics.quantile_band import QuantileBand, quantile_band
from soilml.numerics.resampling import latin_hypercube, systematic_resampling
from soilml.numerics.root_finding import first_bracket, rising_root
from soilml.numerics.sampling.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.subspaces import column_space, project_out

__all__ = [
    "ImportanceSample",
    "Nodes",
    "Prior",
    "QuantileBand",
    "column_space",
    "columns",
    "crowded_ends",
    "crowded_start",
    "first_bracket",
    "gauss",
    "importance_sample",
    "latin_hypercube",
    "moment_matched_weights",
    "prior_quantiles",
    "project_out",
    "quantile_band",
    "rising_root",
    "systematic_resampling",
]
