"""The source papers by name."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Paper:
    """Title of a paper, and its chapters where they differ from the paper's own name.

    Each chapter is a pair CHAPTER.csv and CHAPTER.py in this folder.
    """

    title: str
    chapters: tuple[str, ...] = ()


#: By the name that `soilml papers` takes.
PAPERS: dict[str, Paper] = {
    "nagatani2009": Paper("Nagatani, Ikeda, Sato and Yoshida 2009: a wheel with force sensors"),
    "nagatani_climbing": Paper("Nagatani et al.: online estimation of climbing ability"),
    "wang2018": Paper("Wang, Yan and Du 2018: a tracked robot's mobility"),
    "comin2017": Paper(
        "Comin and Saaj 2017: slip and soil from multi-legged wheel-legs",
        ("comin2017_terradynamics", "comin2017_slip"),
    ),
    "xue2016": Paper("Xue et al. 2016: LS-SVM for the shearing parameters of lunar soil"),
}


def chapters(name: str) -> tuple[str, ...]:
    """The chapters of a paper: its own name if it does not list any."""
    return PAPERS[name].chapters or (name,)
