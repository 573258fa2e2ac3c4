"""The definition of slip is tested by speeds where there are some, else by the fit of the case."""

import numpy as np
import pytest
from simulated_rig import RADIUS, drive, write_csv

from soilml import Operating, read_case
from soilml.errors import InputError, TableError
from soilml.io.read_table import as_table
from soilml.log_import import import_log, init_map
from soilml.log_import.checks.table_hints import table_remarks
from soilml.remarks import about

OF_TYRES = "(r omega - v)/v"


def of_tyres(slip):
    return slip / (1.0 - slip)


def test_a_log_with_speeds_is_refused_with_the_definition_that_they_confirm(tmp_path):
    d = drive(np.random.default_rng(5), slips=(0.1, 0.25, 0.4, 0.5), seconds=10, rate=25.0)
    slip = of_tyres(1.0 - np.divide(d.ground, d.rim, out=np.ones(d.rim.size), where=d.rim > 0.0))
    columns = {"t": d.time, "slip": slip, "omega": d.rim / RADIUS, "v": d.ground,
               "torque": d.torque, "Fz": d.load}  # fmt: skip
    log, path = write_csv(tmp_path / "log.csv", columns), tmp_path / "map.toml"
    text = init_map(log)
    for line in ('radius = "0.15 m', "[slip]", 'column = "slip"'):
        text = text.replace(f"# {line}", line)
    path.write_text(text)
    with pytest.raises(InputError, match=r"write definition = '\(r omega - v\)/v' in \[slip\]"):
        import_log(log, path)
    path.write_text(text.replace("[slip]", f'[slip]\ndefinition = "{OF_TYRES}"'))
    np.testing.assert_allclose(
        import_log(log, path).table["slip"], [0.1, 0.25, 0.4, 0.5], atol=0.03
    )


@pytest.mark.parametrize(("taken", "least", "most"), [(of_tyres, 0.9, 1.0), (np.copy, 0.0, 0.01)])
def test_speeds_in_a_table_tell_the_definition(taken, least, most):
    rng, told = np.random.default_rng(1), []
    for _ in range(200):
        slip = rng.uniform(0.05, 0.45, 10)
        rim = 0.03 * (1.0 + 0.02 * rng.standard_normal())  # a radius that is 2 % off
        columns = {
            "slip": taken(slip) + 0.01 * rng.standard_normal(10),
            "load_N": np.full(10, 60.0),
            "torque_Nm": 3.0 * slip**0.3,
            "rim_speed_m_s": np.full(10, rim),
            "speed_m_s": 0.03 * (1.0 - slip) * (1.0 + 0.01 * rng.standard_normal(10)),
        }
        told.append(bool(about(table_remarks(as_table(columns), None), "slip-definition")))
    assert least <= np.mean(told) <= most


def test_a_table_without_speeds_is_asked_where_the_case_fits_far_better(model_file):
    """Rows of three channels with the shared errors of sensors that are usual, on twelve soils."""
    case, rng = read_case(model_file), np.random.default_rng(5)
    asked = {"ours": 0, "of tyres": 0}
    for _ in range(12):
        truth = {path: prior.at(rng.random()) for path, prior in case.prior.items()}
        true, slip = case.with_values(truth), np.linspace(0.05, 0.45, 16)
        load, gain = rng.choice([40.0, 60.0, 90.0], 16), 1.0 + 0.03 * rng.standard_normal()
        force = true.model(
            true.soil, Operating(slip=slip + 0.01 * rng.standard_normal(), load=load)
        )
        noise = 1.0 + 0.02 * rng.standard_normal(16)
        for name, given in (("ours", slip), ("of tyres", of_tyres(slip))):
            table = as_table(
                {"slip": given, "load_N": load, "torque_Nm": gain * noise * force.torque,
                 "torque_Nm_std": 0.02 * force.torque, "drawbar_pull_N_std": np.full(16, 0.5),
                 "sinkage_m_std": np.full(16, 0.0005),
                 "drawbar_pull_N": force.drawbar_pull + 0.5 * rng.standard_normal(16),
                 "sinkage_m": force.sinkage + 0.0005 * rng.standard_normal(16)}
            )  # fmt: skip
            asked[name] += bool(about(table_remarks(table, case), "slip-definition"))
    assert asked["ours"] == 0 and asked["of tyres"] >= 5


def test_a_slip_above_one_is_refused_with_both_definitions():
    with pytest.raises(
        TableError, match=r"1 - v/\(r omega\); \(r omega - v\)/v = q is q/\(1 \+ q\)"
    ):
        as_table({"slip": [0.2, 1.4], "load_N": [60.0, 60.0], "torque_Nm": [2.0, 3.0]})
