"""Every operator that export c knows: the compiled C against onnxruntime."""

import ctypes
from math import prod

import numpy as np
import onnxruntime as ort
import pytest
from compiled_c import COMPILERS, compile_library
from onnx import TensorProto, helper, numpy_helper

from soilml.errors import ModelFileError
from training.export_c.c_file import kernel_texts
from training.export_c.c_text import array
from training.export_c.operators import OPERATORS
from training.export_c.program import ARRAYS, SharedParts
from training.export_c.tensor import DTYPES, Tensor, kind_of_array
from training.export_c.translation import flat_nodes, translate

RNG = np.random.default_rng(0)


def values(*shape, low=-2.0, high=2.0):
    return RNG.uniform(low, high, shape).astype(np.float32)


A, B = values(4, 3), values(4, 3)
BIG = values(4, 3, low=1.1, high=5.0)
TRUE, OTHER = A > 0, B > 0
ODD = np.array([[np.nan, np.inf, -np.inf, 1.0]], np.float32)
CUBE = values(2, 3, 4)


def ints(*numbers):
    return np.array(numbers, np.int64)


#: Operators of one number.
ONE = {
    **dict.fromkeys(("Log", "Sqrt"), BIG),
    **dict.fromkeys(["Abs", "Asinh", "Cos", "Exp", "Floor", "Identity", "Neg", "Sin", "Tanh"], A),
}
#: Name, operator, inputs that are given at run time, constants that follow them, attributes.
CASES = [
    *((name.lower(), name, [x], [], {}) for name, x in ONE.items()),
    *((op.lower(), op, [A, B], [], {}) for op in ("Add", "Sub", "Mul", "Div", "Max", "Min")),
    *((op.lower(), op, [A, B], [], {}) for op in ("Greater", "GreaterOrEqual", "Less")),
    *((op.lower(), op, [TRUE, OTHER], [], {}) for op in ("And", "Or")),
    ("less or equal", "LessOrEqual", [A, A[:1]], [], {}),
    ("broadcast", "Add", [values(3, 1, 2), values(4, 1)], [], {}),
    ("max of three", "Max", [A, B, BIG], [], {}),
    ("largest with nan", "Max", [ODD, values(1, 4)], [], {}),
    ("smallest with nan", "Min", [ODD, values(1, 4)], [], {}),
    ("sum", "Sum", [A, B, BIG], [], {}),
    ("not", "Not", [TRUE], [], {}),
    ("clip", "Clip", [A], [np.float32(-0.5), np.float32(0.7)], {}),
    ("clip below", "Clip", [A], [np.float32(-0.5)], {}),
    ("where", "Where", [TRUE, A, B], [], {}),
    ("to double", "Cast", [A], [], {"to": TensorProto.DOUBLE}),
    ("to int", "Cast", [A], [], {"to": TensorProto.INT32}),
    ("to bool", "Cast", [np.floor(A)], [], {"to": TensorProto.BOOL}),
    ("from bool", "Cast", [TRUE], [], {"to": TensorProto.FLOAT}),
    *((f"{op} all", op, [A], [], {"keepdims": 0}) for op in OPERATORS if op.startswith("Reduce")),
    *(
        (f"{op} {axis}", op, [CUBE], [ints(axis)], {"keepdims": keep})
        for op in OPERATORS if op.startswith("Reduce")
        for axis, keep in ((0, 1), (1, 0), (2, 1))
    ),
    ("matmul", "MatMul", [values(5, 7), values(7, 70)], [], {}),
    ("matmul of a batch", "MatMul", [values(2, 3, 5, 4), values(3, 4, 6)], [], {}),
    ("matrix by vector", "MatMul", [values(3, 4), values(4)], [], {}),
    ("vector by matrix", "MatMul", [values(4), values(4, 3)], [], {}),
    ("gemm", "Gemm", [values(5, 7), values(7, 33), values(33)], [], {"alpha": -0.5}),
    ("gemm a'", "Gemm", [values(7, 5), values(7, 17)], [], {"transA": 1}),
    ("gemm b'", "Gemm", [values(5, 19), values(6, 19), values(5, 1)], [], {"transB": 1}),
    ("concat", "Concat", [A, B], [], {"axis": 0}),
    ("concat columns", "Concat", [CUBE, values(2, 2, 4)], [], {"axis": 1}),
    ("split", "Split", [CUBE], [], {"axis": 2, "num_outputs": 2}),
    ("split by lengths", "Split", [CUBE], [ints(1, 2)], {"axis": 1}),
    ("slice", "Slice", [CUBE], [ints(1, -3), ints(3, 2**40), ints(1, 2)], {}),
    ("gather", "Gather", [CUBE], [ints(2, 0, -1)], {"axis": 1}),
    ("gather in turn", "Gather", [CUBE], [ints(1, 2)], {"axis": 2}),
    ("gather one", "Gather", [CUBE], [np.array(1, np.int64)], {"axis": 0}),
    ("transpose", "Transpose", [CUBE], [], {"perm": [2, 0, 1]}),
    ("transpose all", "Transpose", [CUBE], [], {}),
    ("expand", "Expand", [values(3, 1)], [ints(2, 3, 4)], {}),
    ("reshape", "Reshape", [CUBE], [ints(0, -1)], {}),
    ("unsqueeze", "Unsqueeze", [A], [ints(0, 3)], {}),
    ("shape", "Shape", [CUBE], [], {}),
]  # fmt: skip
#: Outputs of a node: one unless named here.
OUTPUTS = {"split": 2, "split by lengths": 2}
#: ONNX's own element type of whole numbers that C has as int.
PASSED = {"int64": np.int32, "float32": np.float32, "float64": np.float64, "bool": np.bool_}


def model_of(op, given, constants, attributes, outputs):
    """A model of one node."""
    inputs = [
        helper.make_tensor_value_info(f"x{i}", helper.np_dtype_to_tensor_dtype(x.dtype), x.shape)
        for i, x in enumerate(given)
    ]
    fixed = [numpy_helper.from_array(np.asarray(c), f"k{i}") for i, c in enumerate(constants)]
    names = [f"y{i}" for i in range(outputs)]
    node = helper.make_node(
        op, [*(i.name for i in inputs), *(f.name for f in fixed)], names, **attributes
    )
    ends = [helper.make_empty_tensor_value_info(name) for name in names]
    graph = helper.make_graph([node], "one", inputs, ends, fixed)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)


def function_of(name, model, given, outputs, shared):
    """The function of a model of one node, which takes pointers and working memory."""
    known = {}
    nodes = flat_nodes(model.graph, known)
    tensors = {f"x{i}": Tensor(f"x{i}", kind_of_array(x, ""), x.shape) for i, x in enumerate(given)}
    parameters = {key: f"const {tensor.kind} *{key}" for key, tensor in tensors.items()}
    parameters |= {key: f"void *{key}" for key in outputs} | {"work": "WORK *work"}
    places = {key: key for key in outputs}
    return translate(name, nodes, known, tensors, places, shared, parameters)


def library(folder, functions, shared):
    """Functions compiled together, with a working memory that is large enough for each."""
    lengths = {k: max(f.lengths.get(k, 1) for f in functions) for k in ARRAYS}
    members = " ".join(f"{k} {ARRAYS[k]}[{length}];" for k, length in lengths.items())
    text = "\n".join(
        [
            "#include <math.h>\n#include <stdbool.h>\n#include <string.h>",
            f"typedef struct {{ {members} }} WORK;",
            "WORK memory;",
            *(array(*parts) for parts in shared.constants.values()),
            *kernel_texts(shared),
            *(f.text.removeprefix("static ").replace("static ", "") for f in functions),
        ]
    )
    source, out = folder / "operators.c", folder / "operators.so"
    source.write_text(text)
    unused = ("-Wno-unused", "-Wno-error=unused-const-variable")
    return ctypes.CDLL(str(compile_library(source, out, COMPILERS[0], *unused)))


def called(compiled, function, given):
    """Outputs of a function by name, flat."""
    name, parameters = function.call.removesuffix(")").split("(")
    found = {
        key: np.zeros(max(prod(shape), 1), DTYPES[kind])
        for key, (kind, shape) in function.outputs.items()
    }
    arrays = {k: np.ascontiguousarray(x, PASSED[x.dtype.name]) for k, x in given.items()} | found
    pointers = {k: array.ctypes.data_as(ctypes.c_void_p) for k, array in arrays.items()}
    pointers["work"] = ctypes.byref(ctypes.c_char.in_dll(compiled, "memory"))
    getattr(compiled, name)(*(pointers[key] for key in parameters.split(", ")))
    return found


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    if not COMPILERS:
        pytest.skip("no C compiler")
    shared, functions = SharedParts(), {}
    for index, (name, op, given, constants, attributes) in enumerate(CASES):
        outputs = OUTPUTS.get(name, 1)
        model = model_of(op, given, constants, attributes, outputs)
        names = [f"y{i}" for i in range(outputs)]
        functions[name] = function_of(f"f{index}", model, given, names, shared)
    return functions, library(tmp_path_factory.mktemp("c"), list(functions.values()), shared)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_as_onnxruntime(case, compiled):
    name, op, given, constants, attributes = case
    functions, library_ = compiled
    model = model_of(op, given, constants, attributes, OUTPUTS.get(name, 1))
    feed = {f"x{i}": x for i, x in enumerate(given)}
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    expected = session.run(None, feed)
    found = called(library_, functions[name], feed)
    for y, output in zip(expected, found.values(), strict=True):
        assert output.size == y.size
        np.testing.assert_allclose(output, y.reshape(-1), rtol=2e-6, atol=2e-6)


def test_every_operator_has_a_case():
    assert {case[1] for case in CASES} == set(OPERATORS) - {"Quantiles"}


@pytest.mark.parametrize(
    ("op", "given", "constants", "attributes", "said"),
    [
        ("Einsum", [A, B], [], {"equation": "ij,ij->i"}, "operator Einsum is not known"),
        ("Slice", [A], [ints(0), ints(4), ints(0), ints(2)], {}, "Slice with steps"),
        ("Cast", [A], [], {"to": TensorProto.FLOAT16}, "element type 10"),
        ("Reshape", [A, ints(2, 6)], [], {}, "the shape of Reshape depends on the readings"),
    ],
)
def test_what_is_not_known_is_refused_in_one_line(op, given, constants, attributes, said):
    model = model_of(op, given, constants, attributes, 1)
    with pytest.raises(ModelFileError, match=said) as caught:
        function_of("f", model, given, ["y0"], SharedParts())
    assert "\n" not in str(caught.value)
