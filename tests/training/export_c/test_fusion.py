"""Fusion of several files in C against `fuse_estimates`, number by number."""

import ctypes
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from compiled_c import COMPILERS, ROOT, WARNINGS, CompiledModel, as_arrays

from soilml import Estimator
from soilml.cli import main
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.multi_sensor import fuse_estimates
from training.export_c.fusion import write_fusion

pytestmark = pytest.mark.skipif(not COMPILERS, reason="no C compiler")
#: Largest difference in standard deviations: C computes in float, Python in double.
SAME = 2e-5
#: Codes by the reason that Python gives.
CODES = {
    Reason.ESTIMATED: "OK",
    Reason.OUT_OF_RANGE: "OUT_OF_RANGE",
    Reason.CONTRADICTORY: "CONTRADICTORY",
}
ENDS = ("mean", "std", "low", "high")


def build(folder, sources, compiler=COMPILERS[0] if COMPILERS else "", level="-O1"):
    out = folder / "fused.so"
    command = [compiler, *WARNINGS, level, "-shared", "-fPIC", f"-I{folder}", *sources, "-lm"]
    done = subprocess.run([*command, "-o", out], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0 and done.stderr == "", done.stderr[:3000]
    return out


def given_struct(model, estimate, i):
    """One of many estimates (n, q) as the struct of a file; the other fields are left alone."""
    made = model()
    for key in (*ENDS, "covariance"):
        values = getattr(estimate, key)[i].reshape(-1).tolist()
        setattr(made, key, (ctypes.c_float * len(values))(*values))
    made.in_range = bool(estimate.in_range[i])
    return made


def compare(fusion, structs, estimates, loads):
    """Every row of some estimates (n, q); returns the codes."""
    expected, codes = fuse_estimates(estimates), []
    for i in range(len(estimates[0].mean)):
        arguments = []
        for struct, estimate in zip(structs, estimates, strict=True):
            arguments.append(given_struct(struct, estimate, i))
            if loads:
                arguments.append(ctypes.c_float(estimate.load[i]))
        fused = fusion.new("estimate")
        code, answer = fusion.call("fuse", *arguments, fused), as_arrays(fused)
        own = expected.estimate
        assert code == fusion.codes[CODES[Reason(own.reason[i])]]
        assert answer["in_range"] == own.in_range[i]
        assert list(answer["used"]) == list(expected.used[:, i])
        for key in ENDS:
            assert (np.abs(answer[key] - getattr(own, key)[i]) < SAME * own.std[i]).all(), key
        scale = np.outer(own.std[i], own.std[i])
        assert (
            np.abs(answer["covariance"].reshape(scale.shape) - own.covariance[i]) < scale * SAME
        ).all()
        assert answer["disagreement"] == pytest.approx(expected.disagreement[i], rel=1e-3, abs=1e-4)
        codes.append(code)
    return codes


@pytest.fixture(scope="module", params=["", "_known"])
def slip(request, tmp_path_factory):
    """Both released files of a soil and their fusion, compiled; and the estimators."""
    folder, kind = tmp_path_factory.mktemp("fusion"), request.param
    names = [f"slip_torque{kind}", f"slip_vibration{kind}"]
    models = [str(ROOT / "exported" / f"{name}.onnx") for name in names]
    for name, model in zip(names, models, strict=True):
        assert main(["export", "c", model, str(folder / f"{name}.c")]) == 0
    assert main(["export", "fusion", *models, str(folder / "slip.c")]) == 0
    library = build(folder, [f"{name}.c" for name in (*names, "slip")])
    parts = [CompiledModel(folder / f"{name}.h", library) for name in names]
    return (
        CompiledModel(folder / "slip.h", library),
        parts,
        [Estimator.load(name) for name in names],
    )


def test_slip_from_torque_and_vibration(slip):
    """From readings to the fused estimate: in range, one sensor out of range, contradictory."""
    fusion, parts, estimators = slip
    rng = np.random.default_rng(0)
    readings = {
        "torque": rng.uniform(0.2, 3.0, 600),
        "vibration": rng.uniform(0.0, 8.0, 600),
        "load": rng.uniform(14.0, 36.0, 600),
    }
    estimates = [e(**{k: readings[k] for k in e.inputs}) for e in estimators]
    structs = [part.structs[f"{part.name}_estimate"] for part in parts]
    codes = compare(fusion, structs, estimates, loads=True)
    assert {*codes} == {0, 1, 2}
    rows = [e.inputs for e in estimators]
    for i in range(50):  # the whole way in C
        each = [
            part.single(part.row(**{k: readings[k][i] for k in names}))[0]
            for part, names in zip(parts, rows, strict=True)
        ]
        assert each == [int(not e.in_range[i]) for e in estimates]


def test_different_loads_and_bad_estimates_are_refused(slip):
    fusion, parts, estimators = slip
    readings = {"torque": [1.0], "vibration": [2.0], "load": [25.0]}
    estimates = [e(**{k: readings[k] for k in e.inputs}) for e in estimators]
    one, other = (
        given_struct(part.structs[f"{part.name}_estimate"], e, 0)
        for part, e in zip(parts, estimates, strict=True)
    )
    one.in_range = other.in_range = True

    def code(first, second):
        return fusion.call("fuse", one, ctypes.c_float(first), other, ctypes.c_float(second), fused)

    fused = fusion.new("estimate")
    assert code(25.0, 27.4) >= 0 and code(25.0, 22.6) >= 0
    for second in (27.6, 22.4, np.nan, np.inf):
        assert code(25.0, second) == fusion.codes["DIFFERENT_LOADS"]
    for value in (0.0, -1.0, np.nan, np.inf, 1e-38, 1e38):
        kept, one.std[0] = one.std[0], value
        assert code(25.0, 25.0) == fusion.codes["BAD_ESTIMATE"]
        one.std[0] = kept
    for key in ("mean", "low", "high", "covariance"):
        kept, getattr(one, key)[0] = getattr(one, key)[0], np.nan
        assert code(25.0, 25.0) == fusion.codes["BAD_ESTIMATE"]
        getattr(one, key)[0] = kept
    assert fusion.call("fuse", None, ctypes.c_float(0), other, ctypes.c_float(25), fused) == 0
    assert list(fused.used) == [False, True] and fused.mean[0] == other.mean[0]
    nothing = fusion.call("fuse", None, ctypes.c_float(0), None, ctypes.c_float(0), fused)
    assert nothing == fusion.codes["OUT_OF_RANGE"]


def errors_like(rng, estimator, common, own, size):
    """Held-out rows of a file with errors of its own beside common ones (n, q)."""
    n, q = common.shape
    prior, number = estimator.prior, np.arange(n)
    truth = prior.lower + (prior.upper - prior.lower) * np.random.default_rng(9).random((n, q))
    error = 0.8 * common + own * rng.standard_normal((n, q))
    ones = np.ones((1, q))
    entry = HeldOutErrors(
        number, truth, truth + size * prior.std * error, np.full((n, q), size) * prior.std,
        np.array([1]), ones, 1.6 * ones, "",
    ).entry()  # fmt: skip
    return HeldOutErrors.of(entry)


def test_files_of_three_quantities(tmp_path):
    """By files with made-up errors."""
    base, rng = Estimator.load("wheel_linear"), np.random.default_rng(1)
    common = rng.standard_normal((900, 3))
    kinds = ((0.5, 0.3), (0.9, 0.5))
    estimators = [replace(base, errors=errors_like(rng, base, common, *kind)) for kind in kinds]
    names = ("one", "two")
    for name, text in zip(("all.c", "all.h"), write_fusion(estimators, names, "all"), strict=True):
        (tmp_path / name).write_text(text)
    fields = ", ".join(f"{key}[3]" for key in ENDS)
    for name in names:
        (tmp_path / f"{name}.h").write_text(
            f"#include <stdbool.h>\n#define {name.upper()}_QUANTITIES 3\n"
            f"typedef struct {{ float {fields}, covariance[9]; bool in_range; }} {name}_estimate;\n"
        )
    fusion = CompiledModel(tmp_path / "all.h", build(tmp_path, ["all.c"], level="-O2"))
    members = [(key, ctypes.c_float * 3) for key in ENDS]
    members += [("covariance", ctypes.c_float * 9), ("in_range", ctypes.c_bool)]
    struct = type("part", (ctypes.Structure,), {"_fields_": members})
    truth = base.prior.mean + 0.8 * base.prior.std * rng.standard_normal((400, 3))
    estimates = []
    for (own, size), estimator in zip(kinds, estimators, strict=True):
        std = size * base.prior.std * rng.uniform(0.7, 1.4, (400, 3))
        factor = rng.standard_normal((400, 3, 3)) + 2.0 * np.eye(3)
        raw = factor @ factor.swapaxes(1, 2)
        scale = np.sqrt(np.diagonal(raw, axis1=1, axis2=2))
        covariance = raw / scale[:, :, None] / scale[:, None] * std[:, :, None] * std[:, None]
        mean = truth + std * 1.2 * own * rng.standard_normal((400, 3))
        mean[:4] += 9.0 * std[:4] * rng.choice([-1, 1])
        rounded = (np.float32(x).astype(float) for x in (mean, covariance, std))
        known = (rng.random(400) < 0.7, np.full(3, 1.645), estimator.errors, np.full(400, 60.0))
        estimates.append(Estimate.gaussian(base.names, base.units, base.prior, *rounded, *known))
    codes = compare(fusion, [struct] * 2, estimates, loads=True)
    assert {*codes} == {0, 1, 2}


def test_files_that_cannot_be_fused_are_refused_in_one_line(tmp_path, capsys):
    folder = ROOT / "exported"
    for others, said in (
        (["wheel_linear"], "does not state its errors on held-out rows"),
        (["slip_torque_known"], "do not state their errors on common rows"),
        (["slip_torque"], "each needs another name"),
    ):
        models = [str(folder / f"{name}.onnx") for name in ("slip_torque", *others)]
        assert main(["export", "fusion", *models, str(tmp_path / "slip.c")]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())
