"""Columns of a table as panels: lines by group, units, error bars."""

import matplotlib
import numpy as np

matplotlib.use("Agg")

from soilml.report.column_panels import ColumnPanels

COLUMNS = {
    "slip": [0.3, 0.1, 0.1, 0.3],
    "load_N": [60.0, 60.0, 90.0, 90.0],
    "sinkage_m": [0.02, 0.01, 0.03, np.nan],
    "sinkage_m_std": [0.001, 0.002, 0.001, np.nan],
    "front_share": [0.2, 0.3, 0.2, 0.3],
    "rear_share": [0.1, 0.1, 0.2, 0.2],
}


def test_each_group_is_a_line_in_usual_units_along_the_axis():
    axes = ColumnPanels(COLUMNS, "slip", [("sinkage_m",)], ("load_N",)).plot()
    (panel,) = axes.flat
    assert panel.get_ylabel() == "sinkage, mm" and panel.get_xlabel() == "slip"
    names = [text.get_text() for text in panel.get_legend().get_texts()]
    assert names == ["60 N", "90 N"]
    first, second = (container.lines[0] for container in panel.containers)
    np.testing.assert_allclose(first.get_xydata(), [[0.1, 10.0], [0.3, 20.0]])
    np.testing.assert_allclose(second.get_xydata(), [[0.1, 30.0], [0.3, np.nan]])
    bars = panel.containers[0].lines[2][0].get_segments()
    np.testing.assert_allclose(np.asarray(bars)[0][:, 1], [8.0, 12.0])  # 10 +- 2 mm


def test_columns_of_one_panel_are_told_apart_by_style():
    panels = ColumnPanels(COLUMNS, "slip", [("front_share", "rear_share")], ("load_N",))
    (panel,) = panels.plot().flat
    assert panel.get_ylabel() == "share"
    names = [text.get_text() for text in panel.get_legend().get_texts()]
    assert set(names) == {"front share", "rear share", "60 N", "90 N"}
    assert panels.shape == (1, 1)
