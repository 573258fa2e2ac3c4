"""How often the model calls each transcendental function for a solution, and what a call takes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

#: Functions whose calls are counted, by numpy's name.
FUNCTIONS = ("exp", "log", "power", "sin", "cos", "tan", "arcsin", "arccos", "arctan", "sqrt")
#: Numbers in a call whose time is taken: as many as in the model's arrays of points.
SIZE = 1 << 16
REPEATS = 9

Call = tuple[str, str]  # function and type of number


class CountedArray(np.ndarray[Any, Any]):
    """An array that counts the numbers that functions are called with, on itself and what follows.

    What a function returns is of this class again, so that a whole calculation is counted.
    """

    calls: ClassVar[Counter[Call]] = Counter()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Call and count a function of numpy's."""
        given = options.get("out")
        if given is not None:
            options["out"] = tuple(map(_plain, given))
        result = getattr(ufunc, method)(*map(_plain, inputs), **options)
        if ufunc.__name__ in FUNCTIONS and method == "__call__":
            self.calls[ufunc.__name__, np.asarray(result).dtype.name] += np.size(result)
        return _counted(result) if given is None else given[0]

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        """Call any other function of numpy's, whose result is counted on."""
        result = super().__array_function__(function, types, arguments, options)
        return tuple(map(_counted, result)) if isinstance(result, tuple) else _counted(result)


def _plain(value: Any) -> Any:
    return value.view(np.ndarray) if isinstance(value, CountedArray) else value


def _counted(value: Any) -> Any:
    return np.asarray(value).view(CountedArray) if isinstance(value, np.ndarray) else value


def calls_of(task: Callable[[Mapping[str, Any]], object], rows: Mapping[str, Any]) -> Counter[Call]:
    """Numbers that each function is called with while a task runs on these arrays (batch,)."""
    CountedArray.calls = Counter()
    task({name: np.asarray(value).view(CountedArray) for name, value in rows.items()})
    return CountedArray.calls


def seconds_of(call: Call) -> float:
    """Processor time of one number, fastest of several calls on arrays that stay in the cache."""
    name, kind = call
    function = getattr(np, name)
    x = np.random.default_rng(0).uniform(0.05, 0.95, SIZE // 8).astype(kind)
    arguments = (x, x) if name == "power" else (x,)
    out = np.empty_like(x)
    times = []
    for _ in range(REPEATS):
        started = time.process_time()
        for _ in range(8):
            function(*arguments, out=out)
        times.append(time.process_time() - started)
    return min(times) / SIZE
