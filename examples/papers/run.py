"""The five source papers in their order, picture by picture: what `make demo-papers` runs.

python examples/papers/run.py            run all, and write demo/papers/README.md with the pictures
python examples/papers/run.py --list     say what each picture shows, and run nothing
"""

from __future__ import annotations

import subprocess
import sys
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

HERE, OUT = Path(__file__).parent, Path("demo/papers")


@dataclass(frozen=True)
class Picture:
    """A picture of a script in this folder: what its panels show, by figure of the paper."""

    file: str
    panels: tuple[tuple[str, str], ...]  # Figure or table of the paper, and what is seen


@dataclass(frozen=True)
class Story:
    """A paper, what comes out first, and the scripts that tell it, each with its pictures."""

    paper: str
    told: str
    scripts: dict[str, tuple[Picture, ...]]


INTRODUCTION = (
    "Pictures in the order of the papers; no paper prints its measurements: all are simulated"
)
STORIES = (
    Story(
        "Nagatani et al. 2009: a wheel with force sensors in its rim",
        "One shear modulus, found on level ground from measured stress, predicts the pull on "
        "slopes. Bekker's profile over the visible contact does not.",
        {
            "force_sensor_wheel": (
                Picture(
                    "force_sensor_wheel.png",
                    (
                        ("Fig. 6", "stress on level ground: sensors, truth, deconvolved, Bekker's"),
                        ("Fig. 8", "arcs of 30 degrees move forward with slip"),
                        ("Table I", "k_x put in and found again; triangles are printed"),
                        ("Fig. 11", "pull by k_x of level ground, and what slopes require"),
                    ),
                ),
            )
        },
    ),
    Story(
        "Nagatani et al.: climbing ability before the climb",
        "Climbs of 0 and 4 degrees, and artificial slip, predict the steepest slope to a degree.",
        {
            "climbing": (
                Picture(
                    "climbing.png",
                    (
                        ("Figs. 5, 7", "stress at four artificial slips"),
                        (
                            "Figs. 8, 9",
                            "k_x of each slope, and with an error of 1.5 % of the speed",
                        ),
                        ("Fig. 10", "pull against slip, predicted, and slopes not yet climbed"),
                        ("section 7", "slope climbed at each slip, and the steepest"),
                    ),
                ),
            )
        },
    ),
    Story(
        "Wang, Yan and Du 2018: a tracked robot",
        "Grousers matter on clay and hardly on sand. Eight groups of pulls at one load do not "
        "identify the soil, and still predict the pull.",
        {
            "tracked_robot": (
                Picture(
                    "tracked_robot.png",
                    (
                        ("Figs. 16, 17", "pull on sand and clay, bare and with grousers"),
                        ("Fig. 1, eq. 1", "stress along the belt: soil unloads and reloads"),
                        ("Table 1", "eight groups within their bounds, simulated and printed"),
                        ("Fig. 15 b", "measured against predicted pull of fresh rows"),
                    ),
                ),
            )
        },
    ),
    Story(
        "Comin and Saaj 2017: wheel-legs",
        "Trends of walks are those of the paper, up to the sixth leg. Its line of vibration on "
        "slip needs friction that drops over centimetres; its own spring gives a step.",
        {
            "wheel_legs": (
                Picture(
                    "wheel_legs.png",
                    (
                        ("Fig. 4 a", "a stride, and the stress of the ground on the feet"),
                        ("Fig. 5", "slip and sinkage by number of legs"),
                        ("Fig. 6", "slip and sinkage of four feet as the ground grows firmer"),
                        ("Fig. 12", "stiffness of the soil from midstance sinkage"),
                    ),
                ),
            ),
            "wheel_leg_slip": (
                Picture(
                    "wheel_leg_slip.png",
                    (
                        ("Fig. 8", "torque in midstance against slip, and printed lines"),
                        (
                            "Fig. 9, eqs. 20-23",
                            "a stance of the spring; its amplitude against slip",
                        ),
                        ("Tables VI, IX", "three sensors, and rules of fusion"),
                        ("Fig. 13, Table X", "pull efficiency of a heavy rover, and its classes"),
                    ),
                ),
            ),
            "stick_slip": (
                Picture(
                    "stick_slip.png",
                    (("Table V, eq. 28", "printed lines of vibration, and two springs, by soil"),),
                ),
            ),
            "slip_models": (
                Picture(
                    "slip_models.png",
                    (
                        ("Fig. 10", "slip from torque, learned; soil unknown"),
                        ("Fig. 11", "slip from vibration, learned; soil unknown"),
                        ("Table VI", "both fused, and the coverage of intervals"),
                        ("Tables VIII, IX", "the soil from one stride, by what was read"),
                    ),
                ),
            ),
        },
    ),
    Story(
        "Xue et al. 2016: an LS-SVM for lunar soil",
        "One reading of slip, torque and load is one equation: three parameters need other loads.",
        {
            "lunar_lssvm": (
                Picture(
                    "lunar_single_triple.png",
                    (("section 1", "soils that explain one reading, a sweep, and three loads"),),
                ),
                Picture(
                    "lunar_lssvm.png",
                    (("abstract", "estimates and pull along the sweep of slip at 50 N"),),
                ),
            )
        },
    ),
)


def told(story: Story) -> str:
    """A paper in words: the answer, and what its pictures show, panel by panel."""
    lines = [story.paper, *textwrap.wrap(story.told, 96)]
    for script, pictures in story.scripts.items():
        for picture in pictures:
            lines.append(f"  {picture.file}, by {script}.py")
            lines += [f"    {source:<19} {seen}" for source, seen in picture.panels]
    return "\n".join(lines)


def page() -> str:
    """The stories with their pictures, in Markdown."""
    parts = ["# The five source papers", f"{INTRODUCTION}."]
    for story in STORIES:
        parts += [f"## {story.paper}", story.told]
        for pictures in story.scripts.values():
            for picture in pictures:
                seen = "; ".join(f"{text} ({source})" for source, text in picture.panels)
                parts += [f"![{picture.file}]({picture.file})", f"From left to right: {seen}."]
    return "\n\n".join(parts) + "\n"


def run() -> None:
    """Each script in a process of its own, in the order of the papers; then the numbers."""
    started = time.perf_counter()
    print(INTRODUCTION)
    for number, story in enumerate(STORIES, 1):
        print(f"\n== {number}. {told(story)}", flush=True)
        for script in story.scripts:
            print(f"\n-- {script}.py", flush=True)
            done = subprocess.run([sys.executable, str(HERE / f"{script}.py")])
            if done.returncode != 0:
                sys.exit(f"{script}.py failed with status {done.returncode}")
    print("\n== All printed numbers beside the computed ones: soilml paper numbers ==", flush=True)
    table = OUT / "papers.csv"
    done = subprocess.run([sys.executable, "-m", "soilml", "papers", "--summary", "--out", table])
    (OUT / "README.md").write_text(page(), encoding="utf-8")
    print(f"\n{time.perf_counter() - started:.0f} s; the stories with pictures: {OUT}/README.md")
    sys.exit(done.returncode)


if __name__ == "__main__":
    if "--list" in sys.argv:
        print(f"{INTRODUCTION}\n")
        print("\n".join(told(story) for story in STORIES))
    else:
        run()
