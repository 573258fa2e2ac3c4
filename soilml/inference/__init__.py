"""One posterior over what a model lacks, the errors of its readings, and its soil.

`infer` computes it from a case and readings; `Posterior` answers every question: which effects,
which soil, which predictions, what is left.
"""
