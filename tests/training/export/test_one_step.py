"""One step of a stream as a graph of fixed shapes, beside the file that it was made from."""

import numpy as np
import onnx
import onnxruntime
import pytest

from soilml import Estimator
from soilml.cli import main

WHEEL = {
    "wheel_radius": 0.15,
    "wheel_width": 0.12,
    "bearing_modulus": 1.53e6,
    "n": 1.1,
    "bearing_std": 0.1,
    "cohesion_max": 3000.0,
    "shear_modulus_max": 0.03,
}


def exported(tmp_path, file, *options):
    out = tmp_path / "step.onnx"
    assert main(["export", "step", f"exported/{file}.onnx", str(out), *options]) == 0
    return out


def drive(rng, rows):
    slip, load = rng.uniform(0.05, 0.6, rows), rng.uniform(40.0, 110.0, rows)
    torque = 0.055 * load * (0.35 + slip) * rng.normal(1.0, 0.02, rows)
    sinkage = np.where(rng.random(rows) < 0.5, 0.012 + 1e-4 * load, np.nan)
    return {"slip": slip, "load": load, "torque": torque, "sinkage": sinkage}


@pytest.mark.slow
@pytest.mark.parametrize(("file", "rows"), [("wheel", 1), ("wheel", 3), ("any_wheel", 1)])
def test_a_stream_gets_the_answers_of_the_file(tmp_path, file, rows):
    out = exported(tmp_path, file, "--step-rows", str(rows))
    session = onnxruntime.InferenceSession(str(out), providers=["CPUExecutionProvider"])
    context = WHEEL if file == "any_wheel" else {}
    estimator = Estimator.load(f"exported/{file}.onnx")
    estimator = estimator.on(**context) if context else estimator
    shape = next(i.shape for i in session.get_inputs() if i.name == "memory")
    system, counted = np.zeros(shape, np.float32), np.zeros(3, np.float32)
    memory, measured = estimator.start(), drive(np.random.default_rng(1), 30 * rows)
    for step in range(30):
        part = {k: v[step * rows : (step + 1) * rows] for k, v in measured.items()}
        expected, memory = estimator.step(memory, **part)
        feed = {k: np.nan_to_num(v, nan=-1e30).astype(np.float32) for k, v in part.items()}
        feed |= {k: np.asarray([v], np.float32) for k, v in context.items()}
        names = ["set_mean", "set_std", "set_in_range", "set_misfit", "memory_out", "counted_out"]
        given = {"memory": system, "counted": counted}
        mean, std, inside, misfit, grown, counted = session.run(names, feed | given)
        factor = np.linalg.qr(grown.astype(np.float64), mode="r")
        system = factor.astype(np.float32)
        assert system.shape == tuple(shape)
        assert (mean - expected.mean) / expected.prior.std == pytest.approx(0.0, abs=2e-3)
        assert std / expected.std == pytest.approx(1.0, abs=5e-3)
        assert bool(inside[0]) == bool(expected.in_range)
        assert misfit[0] == pytest.approx(float(expected.misfit), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("file", ["wheel", "any_wheel"])
def test_every_shape_is_a_number(tmp_path, file):
    model = onnx.load(exported(tmp_path, file))
    inferred = onnx.shape_inference.infer_shapes(model, strict_mode=True, data_prop=True).graph
    assert not {"If", "Compress", "NonZero", "Loop"} & {node.op_type for node in inferred.node}
    for value in (*inferred.input, *inferred.output, *inferred.value_info):
        dims = value.type.tensor_type.shape.dim
        assert all(d.HasField("dim_value") for d in dims), value.name
    known = {value.name for value in (*inferred.value_info, *inferred.output)}
    assert known >= {name for node in inferred.node for name in node.output if name}
    names = [node.name for node in model.graph.node]
    assert len(set(names)) == len(names) and all(names)
