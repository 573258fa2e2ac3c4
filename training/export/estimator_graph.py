"""The ONNX graph of a trained model."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.onboard.features import inputs_of, numerator_denominator
from training.onnx_graph.builder import Graph, Output
from training.train import TrainedModel

#: Sums of inputs and features up to this are finite; one with NaN or an infinity is not below it.
LARGEST_SUM = 1e300


def build_graph(trained: TrainedModel) -> Any:
    """The ONNX model, without metadata.

    With a set posterior it has two branches, of which one is run: with the input `joint` true the
    set posterior of all rows, otherwise estimates of single rows. Inputs that a branch does not
    read need not be fed; outputs that it does not compute are empty.
    """
    names = list(inputs_of(trained.spec.features))
    q, posterior = len(trained.spec.targets), trained.set_posterior
    inputs: dict[str, list[Any]] = {name: ["rows"] for name in names}
    outputs: dict[str, Output] = {
        "mean": (1, ["rows", q]),
        "std": (1, ["rows", q]),
        "covariance": (1, ["rows", q, q]),
        "in_range": (9, ["rows"]),
    }
    graph = Graph()
    if posterior is None:
        _add_single_rows(trained, graph, "")
        return graph.model(inputs, outputs)
    rows, sets = Graph("rows_"), Graph("sets_")
    _add_single_rows(trained, rows, "rows_")
    posterior.add_to(sets, "sets_")
    outputs = {
        name: (element_type, [None] * len(shape))
        for name, (element_type, shape) in (outputs | posterior.outputs).items()
    }
    graph.either("joint", sets, rows, outputs)
    for name, value in (posterior.defaults() | {"joint": np.zeros(1, bool)}).items():
        graph.default(name, value)
    return graph.model(inputs | posterior.inputs | {"joint": [1]}, outputs)


def _add_single_rows(trained: TrainedModel, graph: Graph, prefix: str) -> None:
    """Add the estimates of single rows to a graph; outputs are named `<prefix><output>`."""
    spec, estimator = trained.spec, trained.estimator
    names = list(inputs_of(spec.features))
    double = {name: graph.double(name) for name in names}
    total = graph.op("Sum", *double.values())  # (rows,), also where an input has one element
    rows = graph.op("Shape", total)
    double = {name: graph.op("Expand", value, rows) for name, value in double.items()}
    columns = []
    for feature in spec.features:
        top, bottom = numerator_denominator(feature)
        value = graph.op("Div", double[top], double[bottom]) if bottom else double[top]
        columns.append(graph.reshaped(value, -1, 1))
    features = graph.op("Concat", *columns, axis=1)
    finite, features = _add_finite_rows(graph, total, features)
    mean, std = estimator.regressor.add_to_graph(graph, features)
    std = graph.op("Mul", std, graph.constant(estimator.std_scale))
    q = len(spec.targets)
    outer = graph.op("Mul", graph.reshaped(std, -1, q, 1), graph.reshaped(std, -1, 1, q))
    covariance = graph.op("Mul", outer, graph.constant(estimator.correlation))
    inside = graph.op("And", trained.domain.add_to_graph(graph, features), finite)
    graph.op("Identity", inside, out=prefix + "in_range")
    ends = [graph.constant(end) for end in (trained.prior.lower, trained.prior.upper)]
    clipped = graph.op("Min", graph.op("Max", mean, ends[0]), ends[1])
    prior = np.diag(trained.prior.std**2)
    answers = {
        "mean": (clipped, trained.prior.mean, (-1, 1)),
        "std": (std, trained.prior.std, (-1, 1)),
        "covariance": (covariance, prior, (-1, 1, 1)),
    }
    for name, (value, otherwise, shape) in answers.items():
        flag = graph.reshaped(inside, *shape)
        answer = graph.op("Where", flag, value, graph.constant(otherwise))
        graph.single(answer, prefix + name)


def _add_finite_rows(graph: Graph, total: str, features: str) -> tuple[str, str]:
    """Which rows have finite inputs, of which `total` is the sum, and finite features.

    The features of the others are replaced by zeros.
    """
    check = graph.op("Add", total, graph.reduced("ReduceSum", features, 1))
    finite = graph.op("LessOrEqual", graph.op("Abs", check), graph.constant(LARGEST_SUM))
    column = graph.reshaped(finite, -1, 1)
    return finite, graph.op("Where", column, features, graph.constant(0.0))
