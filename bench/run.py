"""Measure the figures of BENCHMARKS.md and write the file: `make bench`."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import advice
import c_export
import generation
import identification
import latency_floor
import learning
import lssvm_scale
import model_errors
import peers
import physics
import prospects
import slip
import soil_tests
import streams
import summary
import systems
import training_time
import wall_time
import wrong_worlds_identified
from benchmarks_file import FILE, MARK, ROOT, machine

from soilml.io.atomic_files import save_text


@dataclass(frozen=True)
class Part:
    """A section of BENCHMARKS.md: name on the command line, title, introduction, measurement.

    `text` gets a temporary folder and returns Markdown.
    """

    name: str
    title: str
    about: str
    text: Callable[[Path], str]


PARTS = (
    Part(
        "summary",
        "At a glance",
        "The best of several calls in one run, on the machine named above; details stand below.",
        lambda folder: summary.text(),
    ),
    Part(
        "accuracy",
        "Accuracy of the rigid wheel",
        "Relative error against adaptive quadrature and bracketing (`tests/reference.py`), over "
        "c 0 to 6 kPa, phi 15 to 50 deg, K 2 to 60 mm, n 0.4 to 1.6, k 4e4 to 1e7 N/m^(n+2), load "
        "5 to 1000 N, r 0.04 to 0.5 m, b 0.02 to 0.4 m. Goal: 1e-6.",
        lambda folder: physics.accuracy(),
    ),
    Part(
        "speed",
        "Speed of the forward model",
        "200 000 operating points in a call, where nothing else is said; the best of three runs, "
        "all cases in turn. The wheel has r 0.15 m and b 0.12 m and stands on soils of the recipe "
        "`wheel`; it drives where nothing else is said.",
        lambda folder: physics.speed(),
    ),
    Part("peers", "The forward model beside other ways", peers.ABOUT, peers.tables),
    Part("generation", "Synthetic data on all cores", generation.ABOUT, generation.section),
    Part(
        "comparison",
        "Estimators and analytic methods relative to the Bayes limit",
        "Written by `soilml compare`; docs/benchmark.md explains the benchmark. Reference wheel, "
        "recipe `benchmark`: c 0 to 3 kPa, phi 25 to 45 deg, K 5 to 30 mm, slip 0.05 to 0.6, load "
        "30 to 120 N, 2 % torque noise, bearing parameters known. A single reading does not "
        "determine three parameters: all methods stay near the prior there, with correspondingly "
        "wide intervals.",
        lambda folder: learning.comparison(),
    ),
    Part(
        "identification",
        "Analytic identification",
        "Three unknown parameters of the recipe `wheel`; torque (2 % noise) and sinkage (0.5 mm) "
        "at four loads (`python bench/identification.py`). The posterior is sampled with "
        "polynomials in place of the model; *model itself*: every sample is solved. The second "
        "table compares the two on simulated sets, in standard deviations of the posterior: "
        "samples of an effective size of 2500 differ by 0.03 (rms) in a mean, and by about twice "
        "that in an end of the 90 % interval. Sets for which no polynomial was accurate enough "
        "are left out; `identify` samples the model for them.",
        lambda folder: identification.text(),
    ),
    Part("soil-tests", "Plate and shear tests beside a wheel", soil_tests.ABOUT, soil_tests.text),
    Part(
        "sets",
        "Set posterior",
        "Estimates of the released files against the exact posteriors of the same simulated "
        "reference sets (`python bench/sets.py`). `any_wheel` is measured on "
        "the reference wheel, as `wheel` is, and over its whole range of wheels, loads, soils, "
        "bearing parameters, noise and bias. Rows labelled *noise from reading*: the standard "
        "deviation of a reading is computed from the reading, as a rover must; otherwise from the "
        "true value.",
        learning.sets,
    ),
    Part(
        "flags",
        "Detection of faulty readings and wrong models",
        "",
        lambda folder: learning.flagged(),
    ),
    Part(
        "model-errors",
        "Wrong sensors and wrong models",
        f"`wheel.onnx` on {model_errors.SETS} soils a line, {model_errors.ROWS} rows each at three "
        "loads, 2 % torque noise (`python bench/model_errors.py`). Sets are simulated by the "
        "reference wheel of blind sets, which shares no code with `soilml`. First the file with "
        "exact sensors and the prior for refused sets, as files were before they knew of errors; "
        "then its two answers: with the usual errors of the sensors, as if the model were right, "
        "and with the usual errors of the model as well (`model_error` 1). Score: mean of the "
        "interval score over parameters and sets, in standard deviations of the prior; the prior "
        "has about 3.3. Last table: the two answers of `identify --method posterior`, without and "
        f"with usual errors, to {wrong_worlds_identified.SETS} sets made in the same way.",
        lambda folder: f"{model_errors.tables()}\n\n{wrong_worlds_identified.section()}",
    ),
    Part(
        "rules",
        "Fusion rules for regressors of the same reading",
        "LS-SVM, MLP and linear regression read the same three numbers, so that their errors are "
        "strongly correlated. The inverse-variance and the pairwise rule assume independence, and "
        "their coverage before recalibration is far below nominal. The default rule, best-linear "
        "(non-negative weights under the shrunk error correlation, then recalibrated), does not "
        "have this defect. *As claimed*: before recalibration on held-out rows. The prior alone "
        "has a negative log density of 1.419.",
        lambda folder: learning.rules(),
    ),
    Part(
        "parity",
        "Parity of the exported files",
        "Largest difference between the float32 file and the float64 estimator. Goal: 1e-4.",
        lambda folder: learning.parity(),
    ),
    Part("lssvm", "LS-SVM against size", lssvm_scale.ABOUT, lssvm_scale.tables),
    Part("training", "Time of training", training_time.ABOUT, training_time.table),
    Part(
        "streams",
        "A day of driving",
        f"{streams.DAYS} simulated days of docs/driving.md on each line, by the reference wheel of "
        "`datagen/blind_sets`: three soils of 100 rows, 2 % torque noise, slip with a standard "
        "deviation of 0.02; 2 % of the rows are glitches (torque doubled or zero, slip off by a "
        "half), torque is stuck for 20 rows, a pause lasts 10 rows, and over the last 150 rows the "
        "friction angle falls by 7 degrees or the zero of the torque sensor rises by 0.5 N m. "
        "Width: median standard deviation over that of the prior. "
        f"Intervals and flag `in_range`: rows from the {streams.SETTLED}th on one soil on, "
        "glitches apart. Alarms: sound rows of unchanged soil that were set aside or called a "
        f"change, drift or stuck sensor. Changes by rms change of torque: how many were told "
        f"within {streams.WITHIN} rows; median and largest delay in rows. Drift: how many were "
        "flagged; median and largest delay. Last column: of the rows in a drift whose mean is off "
        "by more than so many standard deviations, the share that carries a flag, and their "
        "number. `model_error` 1: the file with the usual errors of its model, and without them "
        "otherwise. All usual errors: those of sensors are drawn for each day, those of bearing "
        "and contact for each soil.",
        lambda folder: streams.table(ROOT / "exported" / "wheel.onnx"),
    ),
    Part("loo", "Closed-form leave-one-out", "", lambda folder: learning.leave_one_out()),
    Part(
        "board",
        "Latency on board",
        "Median and 99th percentile (p99) in microseconds, one thread. Goals: 60 us for one "
        "reading, 150 us for a set of 16 (`any_wheel.onnx`: 350 us), 0.2 s to the first estimate, "
        "0.5 MB per file.",
        latency_floor.section,
    ),
    Part(
        "c",
        "Exported C files",
        "`soilml export-c` (docs/c-export.md) beside onnxruntime, one thread. Goals: half of the "
        "latency of onnxruntime, differences as small as those of rounding.",
        c_export.c_export,
    ),
    Part(
        "pull",
        "Bands of drawbar pull and slope",
        "Coverage of 90 % bands of drawbar pull and of the steepest slope (docs/pull.md), over "
        "simulated soils.",
        lambda folder: prospects.prospects(),
    ),
    Part(
        "advice",
        "Experimental design: benefit of the advised reading",
        "Remaining fraction of the prior width after one more reading, where that is the advised "
        "one, a repetition, or a random one (docs/advice.md).",
        lambda folder: "\n\n".join([advice.next_rows(), advice.plans(), advice.from_file()]),
    ),
    Part(
        "gears",
        "Other gears",
        "50 000 operating points each, at typical loads of the gear.",
        lambda folder: systems.gears(),
    ),
    Part(
        "slip",
        "Slip of a wheel-leg",
        "Slip from torque and from vibration (Comin and Saaj 2017, eqs. 18 and 24): the released "
        "linear files, and LS-SVM variants trained on the same data, on strides that no file was "
        "trained on. Each cell: RMSE over the standard deviation of the prior, coverage of the "
        "90 % interval. The rules prior-once and eq. 26 take errors for independent. *World*: what "
        "differs from the recipe of the files. *Disagreement*: difference between the two files in "
        "standard deviations of that difference, 1 where both are right.",
        slip.tables,
    ),
    Part(
        "walking",
        "Walking wheel-legs",
        "Feet none, LTF, SRF and CIF on five legs, and 2, 3 and 6 legs without feet. Goal: one "
        "turn in less than 5 s. Differences are from a solution with the paper's step of 1e-4 s, "
        "and the largest over cases.",
        lambda folder: systems.walking(),
    ),
    Part(
        "climbing",
        "Bands of climbing ability",
        "60 simulated rovers per line on known ground, each slope driven four times: coverage of "
        "the 90 % band, and rms of error over reported standard deviation (1 is calibrated). Pull "
        "at slip 0.4.",
        lambda folder: systems.climbing(),
    ),
    Part(
        "time",
        "Wall time",
        "In an environment that is installed already.",
        lambda folder: wall_time.table(),
    ),
)


def existing_sections() -> dict[str, str]:
    """Sections of the present file, by title."""
    before = FILE.read_text().partition(MARK)[0] if FILE.exists() else ""
    sections = (section.partition("\n") for section in before.split("\n## ")[1:])
    return {title: body.strip("\n") for title, _, body in sections}


def preamble(titles: Sequence[str], environment: str) -> str:
    """What is measured, how, on which machine, and the table of contents."""
    names = ", ".join(part.name for part in PARTS)
    links = "\n".join(f"- [{title}](#{anchor(title)})" for title in titles)
    return (
        "# Benchmarks\n\n"
        "Measured figures of soilml: accuracy and speed of the physics, error and calibration of "
        "the estimators relative to the Bayes limit, detection of faults, latency on board, and "
        "the workflow that finds missing effects. Goals are targets; a goal that is not reached is "
        "marked as missed.\n\n"
        "**Command.** `make bench` writes all sections but the last; `python bench/run.py NAME ...`"
        f" replaces some of them ({names}). `make bench-gap` writes the last. No figure is typed "
        "by hand.\n\n"
        f"**Machine.** {environment}\n\n"
        f"**Contents**\n\n{links}\n"
    )


def anchor(title: str) -> str:
    """The fragment that a Markdown renderer gives a heading."""
    return re.sub(r"[^a-z0-9 _-]", "", title.lower()).replace(" ", "-")


def run(names: Sequence[str]) -> None:
    """Measure all parts, or replace the sections of those named; and write the file."""
    unknown = set(names) - {part.name for part in PARTS}
    if unknown:
        known = ", ".join(part.name for part in PARTS)
        sys.exit(f"no section {', '.join(sorted(unknown))}; there are: {known}")
    texts = existing_sections() if names else {}
    with tempfile.TemporaryDirectory() as folder:
        for part in PARTS:
            if not names or part.name in names:
                about = f"{part.about}\n\n" if part.about else ""
                texts[part.title] = about + part.text(Path(folder))
                print(f"{part.title} ... done", file=sys.stderr, flush=True)
    _, mark, gap = FILE.read_text().partition(MARK) if FILE.exists() else ("", "", "")
    titles = [part.title for part in PARTS if part.title in texts]
    gap_titles = [line[3:] for line in gap.splitlines() if line.startswith("## ")]
    text = preamble([*titles, *gap_titles], machine())
    text += "".join(f"\n## {title}\n\n{texts[title]}\n" for title in titles)
    save_text(FILE, text + mark + gap)
    print("written: BENCHMARKS.md", file=sys.stderr)


if __name__ == "__main__":
    run(sys.argv[1:])
