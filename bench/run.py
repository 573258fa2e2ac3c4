"""Measure the figures of BENCHMARKS.md and docs/benchmarks/, and write them: `make bench`."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))

import advice
import benchmarks_file
import board
import c_export
import code_paths
import generation
import identification
import learning
import lssvm_scale
import model_errors
import physics
import prospects
import slip
import slip_unknown
import small_changes
import small_files
import soil_maps
import soil_tests
import streams
import summary
import systems
import training_time
import wall_time
import wrong_worlds_identified
from benchmarks_file import ROOT, SUMMARY


@dataclass(frozen=True)
class Part:
    """A section: its name on the command line, page, title, introduction and measurement.

    The part without a page is the summary of BENCHMARKS.md. `text` gets a temporary folder and
    returns Markdown.
    """

    name: str
    page: str
    title: str
    about: str
    text: Callable[[Path], str]


PARTS = (
    Part(
        "summary",
        "",
        SUMMARY,
        "The best of several calls in one run, on the machine named above; details stand below.",
        lambda folder: summary.text(),
    ),
    Part(
        "accuracy",
        "forward-model",
        "Accuracy of the rigid wheel",
        "Relative error against adaptive quadrature and bracketing (`tests/reference.py`). "
        "Goal: 1e-6. The input box is c 0 to 6 kPa, phi 15 to 50 deg, K 2 to 60 mm, n 0.4 to "
        "1.6 and k 4e4 to 1e7 N/m^(n+2). Loads are 5 to 1000 N, r is 0.04 to 0.5 m and b 0.02 "
        "to 0.4 m.",
        lambda folder: physics.accuracy(),
    ),
    Part(
        "speed",
        "forward-model",
        "Speed of the forward model",
        "200 000 operating points in a call, where nothing else is said; the best of three runs, "
        "all cases in turn. The wheel has r 0.15 m and b 0.12 m and stands on soils of the recipe "
        "`wheel`; it drives where nothing else is said.",
        lambda folder: physics.speed(),
    ),
    Part(
        "generation",
        "forward-model",
        "Synthetic data on all cores",
        generation.ABOUT,
        generation.section,
    ),
    Part(
        "comparison",
        "identification",
        "Estimators and analytic methods relative to the Bayes limit",
        "Written by `soilml compare`; docs/benchmark.md explains the benchmark. The reference "
        "wheel follows the recipe `benchmark`: c 0 to 3 kPa, phi 25 to 45 deg, K 5 to 30 mm, "
        "slip 0.05 to 0.6, load 30 to 120 N. Torque noise is 2 %, and the bearing parameters "
        "are known. A single reading does not "
        "determine three parameters: all methods stay near the prior there, with correspondingly "
        "wide intervals.",
        lambda folder: learning.comparison(),
    ),
    Part(
        "identification",
        "identification",
        "Analytic identification",
        "Three unknown parameters of the recipe `wheel`; torque (2 % noise) and sinkage (0.5 mm) "
        "at four loads (`python bench/identification.py`). The posterior is sampled with "
        "polynomials in place of the model; *model itself*: every sample is solved. The second "
        "table compares the two on simulated sets, in standard deviations of the posterior. "
        "Samples of an effective size of 2500 differ by 0.03 (rms) in a mean, and by about "
        "twice that in an end of the 90 % interval. Sets for which no polynomial was accurate "
        "enough "
        "are left out; `identify` samples the model for them. The last table has the averaged "
        "answer of `identify` with the exact model's beside it, on blind sets with hidden "
        "effects. *Scaled*: for a core that makes 500,000 forward solutions in a second. "
        "Goal: a median of 2 s for 64 rows.",
        lambda folder: identification.text(),
    ),
    Part(
        "soil-tests",
        "identification",
        "Plate and shear tests beside a wheel",
        soil_tests.ABOUT,
        soil_tests.text,
    ),
    Part(
        "sets",
        "sets",
        "Set posterior",
        "Estimates of the released files against the exact posteriors of the same simulated "
        "reference sets (`python bench/sets.py`). `any_wheel` is measured on "
        "the reference wheel, as `wheel` is, and over its whole range of wheels, loads, soils, "
        "bearing parameters, noise and bias. The noise is a share of the true value. A file is fed "
        "standard deviations that are this share of the reading, as a rover computes them. In "
        "sets of *constant noise*, of 32 rows, the torque noise is 1 to 8 % of the median torque, "
        "and equal in all rows of a set. It is declared by `on(noise=...)`. In lines labelled *fed "
        "by row*, the file is fed this standard deviation with each row instead. It takes it as a "
        "share of the reading, and reads torque too high ([why](../onnx-interface.md#inputs)). A "
        "standard deviation at the true value, which no rover knows, acts in the same way.",
        learning.sets,
    ),
    Part(
        "flags",
        "faults",
        "Detection of faulty readings and wrong models",
        "",
        lambda folder: learning.flagged(),
    ),
    Part(
        "model-errors",
        "faults",
        "Wrong sensors and wrong models",
        f"`wheel.onnx` on {model_errors.SETS} soils a line, {model_errors.ROWS} rows each at three "
        "loads, 2 % torque noise (`python bench/model_errors.py`). Sets are simulated by the "
        "reference wheel of blind sets, which shares no code with `soilml`. First comes the "
        "file with exact sensors and the prior for refused sets. Answers with typical errors of "
        "the sensors follow: with an exact model (`model_error` 0), with typical errors of the "
        "model (`model_error` 1), and the file's own answer, which infers their size. "
        "Score: mean of the interval score over parameters and sets, in standard deviations of "
        "the prior; the prior has about 3.3. Last table: the averaged answer "
        "of `identify` and its `exact_model`, on "
        f"{wrong_worlds_identified.SETS} sets made in the same way.",
        lambda folder: f"{model_errors.tables(folder)}\n\n{wrong_worlds_identified.section()}",
    ),
    Part(
        "rules",
        "sets",
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
        "sets",
        "Parity of the exported files",
        "Largest difference between the float32 file and the float64 estimator. Goal: 1e-4.",
        lambda folder: learning.parity(),
    ),
    Part("lssvm", "training", "LS-SVM against size", lssvm_scale.ABOUT, lssvm_scale.tables),
    Part("training", "training", "Time of training", training_time.ABOUT, training_time.table),
    Part(
        "streams",
        "driving",
        "A day of driving",
        f"{streams.DAYS} simulated days of docs/driving.md on each line, by the reference wheel "
        "of `datagen/blind_sets`. A day has three soils of 100 rows, 2 % torque noise, and slip "
        "with a standard deviation of 0.02. Of the rows, 2 % are glitches (torque doubled or "
        "zero, slip off by a half); torque is stuck for 20 rows, slip for 15, and a pause lasts "
        "10. "
        "Over the last 150 rows the friction angle falls by 7 degrees or the zero of the torque "
        "sensor rises by 0.5 N m. "
        "Width: median standard deviation over that of the prior. "
        f"Intervals and flag `in_range`: rows from the {streams.SETTLED}th on one soil on, "
        "glitches apart; the flag of rows that the tracker used. "
        "Alarms: sound rows of unchanged soil that were set aside or called a "
        "change, drift or stuck sensor. Changes by rms change of torque: how many were detected "
        f"within {streams.WITHIN} rows; median and largest delay in rows. Drift: how many were "
        "flagged; median and largest delay. Last column: of the rows in a drift whose mean is off "
        "by more than so many standard deviations, the share that carries a flag, and their "
        "number. Averaged: over sizes of the model's errors, as by default. Slip stuck: the most "
        "rows of it that were used on a day, up to the last. "
        "All typical errors: those of sensors are drawn for each day, those of "
        "bearing and contact for each soil.",
        lambda folder: streams.table(ROOT / "exported" / "wheel.onnx"),
    ),
    Part(
        "small-changes",
        "driving",
        "Small changes of soil",
        f"{small_changes.DAYS} simulated days as modelled, on which torque changes by 5 to 12 % "
        "(rms) "
        "from each soil to the next; glitches and stuck sensors as above. The best possible filter "
        "knows the wheel, the noise, the prior, the rate of changes and the glitches, and tells a "
        f"change at a probability of {small_changes.TOLD:g}; its soils are {small_changes.SOILS} "
        "points of the prior. False changes: rows of unchanged soil, from the "
        f"{small_changes.LATE}th on.",
        lambda folder: small_changes.table(ROOT / "exported" / "wheel.onnx"),
    ),
    Part(
        "slip-unknown",
        "driving",
        "Slip without odometry",
        slip_unknown.ABOUT,
        lambda folder: slip_unknown.table(),
    ),
    Part(
        "map",
        "driving",
        "Soil along the way",
        soil_maps.ABOUT,
        lambda folder: soil_maps.table(),
    ),
    Part(
        "loo", "training", "Closed-form leave-one-out", "", lambda folder: learning.leave_one_out()
    ),
    Part(
        "board",
        "board",
        "Latency on board",
        "Median and 99th percentile (p99) in microseconds, one thread. Goals: 60 us for one "
        "reading, 150 us for a set of 16 (`any_wheel.onnx`: 350 us), 0.2 s to the first estimate, "
        "0.5 MB per file.",
        board.section,
    ),
    Part(
        "c",
        "board",
        "Exported C files",
        "`soilml export-c` beside onnxruntime, one thread; memory: [docs/c-export.md]"
        "(../c-export.md#memory). Goals: half of the latency of onnxruntime, differences as small "
        "as those of rounding.",
        c_export.c_export,
    ),
    Part(
        "small",
        "board",
        "Files for a microcontroller",
        "`wheel_small.onnx` and `any_wheel_small.onnx` beside the full files, on the reference "
        "sets of [sets.md](sets.md). Goals: RMSE at most 1.05 of the exact one, log density within "
        "0.1 nat of the full file, coverage 87 to 93 %, the same flags.",
        small_files.section,
    ),
    Part(
        "pull",
        "prospects",
        "Bands of drawbar pull and slope",
        "Coverage of 90 % bands of drawbar pull and of the steepest slope (docs/pull.md), over "
        "simulated soils.",
        lambda folder: prospects.prospects(),
    ),
    Part(
        "advice",
        "prospects",
        "Experimental design: benefit of the advised reading",
        "Remaining fraction of the prior width after one more reading, where that is the advised "
        "one, a repetition, or a random one (docs/advice.md).",
        lambda folder: "\n\n".join([advice.next_rows(), advice.plans(), advice.from_file()]),
    ),
    Part(
        "gears",
        "forward-model",
        "Other gears",
        "50 000 operating points each, at typical loads of the gear.",
        lambda folder: systems.gears(),
    ),
    Part(
        "slip",
        "systems",
        "Slip of a wheel-leg",
        "Slip from torque and from vibration (Comin and Saaj 2017, eqs. 18 and 24). The "
        "released linear files, and LS-SVM variants trained on the same data, are tested on "
        "strides that no file was trained on. Each cell: RMSE over the standard deviation of "
        "the prior, coverage of the "
        "90 % interval. The rules prior-once and eq. 26 take errors for independent. *World*: what "
        "differs from the recipe of the files. *Disagreement*: difference between the two files in "
        "standard deviations of that difference, 1 where both are right.",
        slip.tables,
    ),
    Part(
        "walking",
        "systems",
        "Walking wheel-legs",
        "Feet none, LTF, SRF and CIF on five legs, and 2, 3 and 6 legs without feet. Goal: one "
        "turn in less than 5 s. Differences are from a solution with the paper's step of 1e-4 s, "
        "and the largest over cases.",
        lambda folder: systems.walking(),
    ),
    Part(
        "climbing",
        "prospects",
        "Bands of climbing ability",
        "60 simulated rovers per line on known ground, each slope driven four times: coverage of "
        "the 90 % band, and rms of error over reported standard deviation (1 is calibrated). Pull "
        "at slip 0.4.",
        lambda folder: systems.climbing(),
    ),
    Part(
        "time",
        "software",
        "Wall time",
        "In an environment that is installed already.",
        lambda folder: wall_time.table(),
    ),
    Part("code", "software", "Paths through the code", code_paths.ABOUT, code_paths.section),
)


def run(names: Sequence[str]) -> None:
    """Measure all parts, or replace the sections of those named; and write their pages."""
    known = [part.name for part in PARTS]
    if unknown := set(names) - set(known):
        sys.exit(f"no section {', '.join(sorted(unknown))}; there are: {', '.join(known)}")
    measured = [part for part in PARTS if not names or part.name in names]
    summary = ""
    with tempfile.TemporaryDirectory() as folder:
        for part in measured:
            text = f"{part.about}\n\n{part.text(Path(folder))}".strip()
            print(f"{part.title} ... done", file=sys.stderr, flush=True)
            if part.page:
                order = [other.title for other in PARTS if other.page == part.page]
                benchmarks_file.write_page(part.page, order, {part.title: text})
            else:
                summary = text
    benchmarks_file.write_first_page(known, summary)
    written = dict.fromkeys(benchmarks_file.page_file(part.page) for part in measured)
    print(f"written: {', '.join(str(file.relative_to(ROOT)) for file in written)}", file=sys.stderr)


if __name__ == "__main__":
    run(sys.argv[1:])
