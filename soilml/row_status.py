"""Why a row has, or has not, an answer."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """One code per row of a batch; `OK` is 0, so `status == 0` selects the answers."""

    OK = 0
    TOO_HEAVY = 1
    NO_PEAK = 2
    NO_BEARING = 3
    NOT_CONVERGED = 4
    NOT_SIMULATED = 5

    @property
    def reason(self) -> str:
        """The code in words, as tables print it."""
        return _REASONS[self]


_REASONS: dict[Status, str] = {
    Status.OK: "ok",
    Status.TOO_HEAVY: "no equilibrium: the soil carries less than this load at any sinkage "
    "up to the hub",
    Status.NO_PEAK: "no stress profile: the angle of maximum stress lies outside the contact, "
    "a0 + a1 slip must be above 0 and below 1",
    Status.NO_BEARING: "no bearing: kc / width + kphi is not positive",
    Status.NOT_CONVERGED: "no equilibrium found: the search for the sinkage did not converge",
    Status.NOT_SIMULATED: "not simulated: slip or load lies outside the runs of the simulator",
}
