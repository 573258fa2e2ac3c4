"""The numbers printed in the source papers, compared with those that soilml computes.

To add a paper, write two files in this folder and one line in `PAPERS` of `published.py`.
`NAME.csv` has one row per printed number (columns in `COLUMNS`). In `NAME.py`, `COMPUTED` maps keys
of the CSV file to functions without arguments. `INPUTS`, if present, are the keys of inputs that
the model keeps as printed. A row that no function computes, or that is known to miss its tolerance,
must state a reason.
"""
