"""How old the blocks of pages are, by the code that their commands run.

`page_states.json` has, for each command, a hash of each room that it can reach by imports, as it
was when the blocks were written. Hashes are of the syntax, without comments and docstrings, and of
the data files beside it. A room that has changed since need not have changed a figure, and most
changes do not: the list is a hint what to run again, and no test fails on it.
"""

from __future__ import annotations

import ast
import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
STATES = "tools/page_states.json"
PACKAGES = ("soilml", "datagen", "training")
DATA = {".csv", ".toml", ".json", ".j2"}

#: Hashes of rooms, by their folder.
State = dict[str, str]


def read_states(root: Path = ROOT) -> dict[str, State]:
    """The state of each command at which its blocks were written."""
    path = root / STATES
    return json.loads(path.read_text()) if path.exists() else {}


def write_states(states: Mapping[str, State], root: Path = ROOT) -> None:
    """Write the states, a command a line, so that two branches seldom change the same one."""
    lines = [
        f"{json.dumps(name)}: {json.dumps(states[name], sort_keys=True)}" for name in sorted(states)
    ]
    (root / STATES).write_text("{\n" + ",\n".join(lines) + "\n}\n")


def changed_rooms(then: State, now: State) -> list[str]:
    """Rooms that are new, gone or different."""
    return sorted(room for room in {*then, *now} if then.get(room) != now.get(room))


def state_of(command: str, root: Path = ROOT) -> State:
    """Hashes of the rooms that a command can reach: its script, and all that it imports in turn."""
    parts: dict[str, list[str]] = {}
    for file in sorted(_reached(_start(command, root), root)):
        own = file.relative_to(root)
        # a script is a room of its own; of a package, the folder is
        room = own.parent if own.parts[0] in PACKAGES else own
        parts.setdefault(str(room), []).append(_code_hash(file))
    for room, hashes in parts.items():
        if (root / room).is_dir():
            hashes += [_data_hash(file) for file in _data(root / room)]
    return {room: hashlib.sha256("".join(h).encode()).hexdigest()[:8] for room, h in parts.items()}


def _start(command: str, root: Path) -> Path:
    """The file that a command runs: a script, or the module of a command of soilml."""
    words = [word for word in shlex.split(command) if word not in ("python", "-m", "soilml")]
    if words[0].endswith(".py"):
        return root / words[0]
    return root / "soilml" / "cli" / "commands" / f"{words[0].replace('-', '_')}.py"


def _reached(start: Path, root: Path) -> set[Path]:
    found, waiting = {start}, [start]
    while waiting:
        for file in _imported(waiting.pop(), root):
            if file not in found:
                found.add(file)
                waiting.append(file)
    return found


@cache
def _imported(file: Path, root: Path) -> tuple[Path, ...]:
    """Files of the repository that a file imports, wherever in it the import stands."""
    names: set[str] = set()
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    beside = (root, file.parent)
    paths = (folder / name.replace(".", "/") for name in sorted(names) for folder in beside)
    candidates = (
        option for path in paths for option in (path.with_suffix(".py"), path / "__init__.py")
    )
    return tuple(dict.fromkeys(option for option in candidates if option.is_file()))


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def _code_hash(file: Path) -> str:
    """Hash of the syntax of a file without docstrings; formatting and comments do not count."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_text(body[0]):
            del body[0]
    return hashlib.sha256(ast.unparse(tree).encode()).hexdigest()


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _data(folder: Path) -> Iterator[Path]:
    """Data files of a room, and those of its folders without code."""
    inner = [f for f in sorted(folder.iterdir()) if f.is_dir() and not any(f.glob("*.py"))]
    for own in (folder, *inner):
        yield from sorted(f for f in own.iterdir() if f.suffix in DATA)


@cache
def _data_hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
