"""Names of the files that the output folder of a command receives."""

#: Of --report.
REPORT_FILES = ("report.html", "report.json")
#: Of `soilml climb`.
CLIMB_FILES = ("report.html", "climb.json", "curve.csv", "climbs.csv")
#: Of `soilml gap`.
GAP_FILES = ("report.html", "gap.json", "model.toml", "next_runs.csv")
#: A further file where causes are suspected but not named: the model with the first suspect.
GAP_SUSPECTED = "model_suspected.toml"
#: Endings of the table of `soilml import`, its report and the errors that all rows share.
IMPORT_SUFFIXES = (".csv", ".report.html", ".report.json", ".bias.toml")
