"""Files whose new rows depend on the memory: a step then runs the whole graph."""

import numpy as np
import pytest
from simulated_rows import context_of, rows_of

#: Distance of an answer from the memory alone, in standard deviations: rows were linearised at the
#: soil that was known when they came.
NEAR = 0.3


@pytest.mark.slow
def test_the_answer_from_the_memory_alone_is_near_that_of_the_step(compiled):
    model, rng = compiled("any_wheel"), np.random.default_rng(7)
    for _ in range(8):
        context = context_of(rng)
        memory = model.start(**context)
        for count in (3, 17, 32):
            rows = rows_of(rng, count, context)
            code, stepped = model.update(memory, model.rows(**rows))
            if code >= 0:
                _, alone = model.answer(memory)
                error = np.abs(alone["mean"] - stepped["mean"]) / stepped["std"]
                assert (error < NEAR).all()
