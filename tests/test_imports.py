"""Imports point one way, ROS stays in its room, --help is light, and class names are unique."""

import ast
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path

import ros_visualise

ROOT = Path(ros_visualise.__file__).parent
LAYERS = [
    {"core"},
    {"data", "geometry"},
    {"messages", "vision"},
    {"links"},
    {"sources", "sinks"},
    {"plotting"},
    {"landmarks"},
    {"estimation"},
    {"simulation"},
    {"nodes"},
    {"graph"},
    {"lessons"},
    {"runtime"},
    {"ui"},
    {"running"},
    {"batch"},
    {"api"},
    {"commands"},
    {"__main__"},
]
RUNTIMES = [set[str](), {"bridge"}, {"remote"}, {"ros1", "ros2", "zenoh"}]
"""Within the runtime: a room imports those before it; what is not named belongs to the first."""

EVERYWHERE = {
    *("ros_visualise", "numpy", "cv2", "PIL", "av", "mujoco", "trimesh", "tqdm"),
    *("pyapriltags", "argcomplete", "fastapi", "nicegui", "uvicorn"),
    *("rosbags", "mcap", "lz4", "zstandard", "ruamel", "websockets", "msgspec", "cbor2"),
    *("onnxruntime", "rasterio"),
    *("duckdb", "dask", "distributed"),
    *sys.stdlib_module_names,
}
MIDDLEWARES = {
    "ros1": {
        *("rospy", "rosgraph", "rospkg", "genpy", "dynamic_reconfigure"),
        *("rosgraph_msgs", "sensor_msgs", "std_srvs"),
    },
    "ros2": {
        *("rclpy", "ament_index_python", "rcl_interfaces"),
        *("rosgraph_msgs", "sensor_msgs", "std_srvs"),
    },
    "zenoh": {"zenoh"},
    "links": {"pymavlink"},
}
"""A middleware's folder, most under ``runtime`` -> packages that may be imported there alone."""

CHOOSE = {ROOT / "running" / "executables" / "__init__.py", ROOT / "running" / "network.py"}
"""The only places that choose a middleware: for a ROS executable, and for the command line."""


def layer_of(room: str) -> int:
    return next(number for number, rooms in enumerate(LAYERS) if room in rooms)


def level_of(room: str) -> int:
    return next((number for number, rooms in enumerate(RUNTIMES) if room in rooms), 0)


@cache
def parsed(path: Path) -> list[ast.AST]:
    return list(ast.walk(ast.parse(path.read_text())))


@cache
def imported_names(path: Path) -> set[str]:
    names: set[str] = set()
    for node in parsed(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
        elif isinstance(node, ast.Call) and _name_of(node.func) == "import_module":
            names |= {str(one.value) for one in node.args if isinstance(one, ast.Constant)}
    return names


def _name_of(called: ast.expr) -> str:
    return called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")


def test_the_top_of_the_package_is_a_list_of_rooms():
    rooms = {path.name for path in ROOT.iterdir() if path.is_file() or any(path.rglob("*.py"))}
    assert rooms - {"__init__.py", "__main__.py", "py.typed"} <= set().union(*LAYERS)
    assert len(rooms) <= 24


FILES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


def test_imports_point_down():
    for path in FILES:
        own = path.relative_to(ROOT).parts[0].removesuffix(".py")
        for name in imported_names(path):
            package, _, rest = name.partition(".")
            if package == "ros_visualise" and rest:
                room = rest.partition(".")[0]
                is_below = room == own or layer_of(room) <= layer_of(own)
                assert is_below, f"{path} imports {name}"
            is_own = package in MIDDLEWARES.get(path.parent.name, ())
            assert is_own or package in EVERYWHERE, f"{path} imports {name}"


def test_a_middleware_is_imported_by_nobody_but_itself():
    for path in FILES:
        place = path.relative_to(ROOT).parts
        own = place[1].removesuffix(".py") if place[0] == "runtime" else ""
        for name in imported_names(path):
            parts = name.split(".")
            if parts[:2] != ["ros_visualise", "runtime"] or len(parts) == 2 or parts[2] == own:
                continue
            assert parts[2] not in MIDDLEWARES or path in CHOOSE, f"{path} imports {name}"
            assert not own or level_of(parts[2]) <= level_of(own), f"{path} imports {name}"


def test_no_module_shadows_what_it_imports():
    for path in FILES:
        assert path.stem not in {name.partition(".")[0] for name in imported_names(path)}, path


def test_what_opens_everything_is_above_it():
    """`sources.opening` imports the rooms of `sources`; none of them imports it, or another one."""
    rooms = {"kitti", "logs", "recordings"}
    allowed = {"kitti": {"recordings"}, "logs": {"recordings"}, "recordings": set()}
    for room in rooms:
        for path in (ROOT / "sources" / room).rglob("*.py"):
            found = {
                n.split(".")[2]
                for n in imported_names(path)
                if n.count(".") > 1 and n.startswith("ros_visualise.sources.")
            }
            assert not found & ({*rooms, "opening"} - {room} - allowed[room]), path


def test_help_imports_nothing_heavy():
    code = (
        "import sys, ros_visualise.commands as commands\n"
        "for words in ([], *([name] for name in commands.COMMANDS.builtin)):\n"
        "    try: commands.main([*words, '--help'])\n"
        "    except SystemExit: pass\n"
        "print([m for m in ('numpy', 'cv2', 'av', 'nicegui') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_class_names_are_unique():
    places = defaultdict(list)
    for path in sorted(ROOT.rglob("*.py")):
        for node in parsed(path):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not {name: where for name, where in places.items() if len(where) > 1}
