"""The source papers, number by number: what they print beside what soilml computes.

A chapter is a CSV file of what is printed and the module of the same name, whose `COMPUTED` holds
a function of no arguments for each key, and whose `GIVEN`, where there is one, the keys of inputs
that are kept as printed. A new paper is such a pair and one line here.
"""

from __future__ import annotations

#: Chapters by paper; each is NAME.csv and NAME.py in this folder.
PAPERS: dict[str, tuple[str, ...]] = {
    "nagatani2009": ("nagatani2009",),
    "nagatani_climbing": ("nagatani_climbing",),
    "wang2018": ("wang2018",),
    "comin2017": ("comin2017_terradynamics", "comin2017_slip"),
    "xue2016": ("xue2016",),
}

#: What each paper is.
TITLES: dict[str, str] = {
    "nagatani2009": "Nagatani, Ikeda, Sato and Yoshida 2009: a wheel with force sensors",
    "nagatani_climbing": "Nagatani et al.: online estimation of climbing ability",
    "wang2018": "Wang, Yan and Du 2018: a tracked robot's mobility",
    "comin2017": "Comin and Saaj 2017: slip and soil from multi-legged wheel-legs",
    "xue2016": "Xue et al. 2016: LS-SVM for the shearing parameters of lunar soil",
}
