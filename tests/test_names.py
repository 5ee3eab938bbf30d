"""Names of classes are unique in the package, so that a name alone says which class is meant."""

import ast
from collections import defaultdict
from pathlib import Path

import ros_visualise

ROOT = Path(ros_visualise.__file__).parent


def test_class_names_are_unique():
    places = defaultdict(list)
    for path in sorted(ROOT.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not {name: where for name, where in places.items() if len(where) > 1}
