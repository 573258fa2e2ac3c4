"""The numbers printed in the source papers, compared with those that soilml computes.

To add a paper: write `NAME.csv` with one row per printed number (columns in `COLUMNS`), write
`NAME.py` whose `COMPUTED` maps keys of the CSV file to functions without arguments (and whose
`INPUTS`, if present, holds the keys of inputs that the model keeps as printed), both in this
folder, and add one line to `PAPERS` in `published.py`. A row that no function computes, or that is
known to miss its tolerance, must state a reason.
"""
