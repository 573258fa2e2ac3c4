"""The numbers printed in the source papers, compared with those that soilml computes.

To add a paper, write two files in this folder and one line in `PAPERS` of `published.py`.
`NAME.csv` has one row per printed number (columns in its first line), with what the number is
(`STATUSES`). In `NAME.py`, `COMPUTED` maps keys of the CSV file to functions without arguments. A
number that its own model was given is `recovered`; one for which something was chosen that is not
printed is `tuned`; neither is `reproduced`.
"""
