"""From raw logs to the soil, and the picture of docs/how-to/import.md: `make demo-import`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from rig import write_logs

from soilml.cli import main
from soilml.log_import import import_log
from soilml.log_import.import_report import draw_run, rows_over_slip, run_panels
from soilml.report.figure_style import report_style

FOLDER = Path("demo/import")
#: What a look at the map changes: the gear ratio, which no log tells.
EDIT = ("gear_ratio = 1 ", "gear_ratio = 99 ")


def run(*command: str) -> None:
    """Run a command and show it."""
    print(f"\n$ soilml {' '.join(command)}", flush=True)
    main(command)


def picture(logs: list[str], chart: Path, target: Path) -> None:
    """Two runs over time and the rows over slip, as the report has them."""
    import matplotlib.pyplot as plt

    imported = import_log(logs, chart)
    with report_style():
        figure = plt.figure(figsize=(15.2, 4.8), layout="constrained")
        first, second, third = figure.subfigures(1, 3)
        for canvas, series in zip((first, second), imported.series[::3], strict=False):
            draw_run(series, imported.table, canvas.subplots(len(run_panels(series)), 1))
        rows_over_slip(imported.table).draw(third.subplots(2, 1, sharex=True))
        first.axes[-1].set_xlabel("time, s; sand_1")
        second.axes[-1].set_xlabel("time, s; sand_4: somebody pulls on the carriage at the end")
        figure.savefig(target, dpi=80, facecolor="white")


if __name__ == "__main__":
    logs = [str(path) for path in write_logs(FOLDER)]
    chart, runs = FOLDER / "map.toml", FOLDER / "runs.csv"
    chart.unlink(missing_ok=True)
    run("import", "--init", *logs, "--out", str(chart))
    run("import", *logs, "--map", str(chart), "--out", str(runs))
    print(f"\nin {chart}: {EDIT[0].strip()} -> {EDIT[1].strip()}")
    chart.write_text(chart.read_text().replace(*EDIT))
    run("import", *logs, "--map", str(chart), "--out", str(runs))
    model = FOLDER / "with_bias.toml"
    shared = runs.with_suffix(".bias.toml").read_text()
    model.write_text(f"{(FOLDER / 'model.toml').read_text()}\n{shared}")
    run("identify", str(model), str(runs), "--out", str(FOLDER / "soil.json"))
    picture(logs, chart, FOLDER / "import.png")
    print(f"\npicture: {FOLDER / 'import.png'}; report: {runs.with_suffix('.report.html')}")
