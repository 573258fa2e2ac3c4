"""The table of `make coverage`: counts of files are summed by room, not their shares averaged."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("reached", ROOT / "tools" / "reached.py")
reached = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(reached)


def counts(*numbers):
    return {"summary": dict(zip(reached.COUNTS, numbers, strict=True))}


def test_shares_are_of_all_lines_of_a_room():
    files = {
        "soilml/gap/a.py": counts(30, 30, 0, 0),
        "soilml/gap/search/b.py": counts(10, 5, 8, 2),
        "soilml/errors.py": counts(4, 4, 0, 0),
    }
    rooms = reached.by_room(files)
    assert rooms == {"soilml": [4, 4, 0, 0], "soilml/gap": [40, 35, 8, 2]}
    assert reached.table(rooms).splitlines()[2:] == [
        "| `soilml` | 4 | 100.0 % | 0 |  |",
        "| `soilml/gap` | 40 | 87.5 % | 8 | 25.0 % |",
        "| all | 44 | 88.6 % | 8 | 25.0 % |",
    ]
