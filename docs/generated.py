"""The pages that declarations give: nodes, commands, messages, formats, lessons, the gallery."""

import argparse
import ast
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import links

DOCS = Path(__file__).parent
FOLDER = DOCS / "generated"
EXAMPLES = links.ROOT / "examples"
PICTURES = DOCS / "pictures"


def version() -> str:
    """Version of the package."""
    return re.search("<version>(.*)</version>", (links.ROOT / "package.xml").read_text())[1]


def write(lessons: bool = True) -> None:
    """Write all pages; one that says the same as before keeps its time, and is not read again."""
    pages = {**_copied(), **_nodes(), **_commands(), **_gallery()}
    pages |= {"messages": _messages(), "formats": _formats()}
    pages |= _lessons(lessons)
    for name, lines in pages.items():
        path, text = FOLDER / f"{name}.md", "\n".join(lines) + "\n"
        if not path.exists() or path.read_text() != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    for old in FOLDER.rglob("*.md"):
        name = str(old.relative_to(FOLDER)).removesuffix(".md")
        if name not in pages and not name.startswith("lessons/"):
            old.unlink()


def _copied() -> dict[str, list[str]]:
    return {
        page.removeprefix("generated/").removesuffix(".md"): [
            links.rewritten((links.ROOT / source).read_text(), source)
        ]
        for source, page in links.PAGES.items()
    }


def _nodes() -> dict[str, Iterable[str]]:
    from ros_visualise.nodes import NODES

    found = {name: NODES.find(name) for name in sorted(NODES.builtin)}
    rows = [(f"[{name}](nodes/{name}.md)", _text(one.doc)) for name, one in found.items()]
    index = ["# All nodes", "", *_table("", ("node", "what it does"), rows), *_contents("nodes")]
    return {"nodes": index, **{f"nodes/{name}": _node(one) for name, one in found.items()}}


def _node(declared) -> Iterator[str]:
    from ros_visualise.core.params import specs
    from ros_visualise.graph import place, place_source
    from ros_visualise.sources.declarations import SourceType

    is_source = isinstance(declared, SourceType)
    member = place_source(declared) if is_source else place(declared, {})
    yield from (f"# {declared.name}", "", declared.doc, "")
    yield from (f"![{declared.doc}]({one})" for one in _picture(f"nodes/{declared.name}", "../../"))
    yield ""
    if declared.inputs:
        rows = [(f"`{port}`", f"`{kind.type_name}`") for port, kind in declared.inputs.items()]
        yield from _table("Inputs", ("input", "message"), rows)
    rows = [
        (f"`{port}`", f"`{member.outputs[port]}`", f"`{kind.type_name}`", _when(declared, port))
        for port, kind in declared.outputs.items()
    ]
    yield from _table("Outputs", ("output", "usual topic", "message", ""), rows)
    actions = [(f"`{name}`", _text(help)) for name, help in declared.actions.items()]
    yield from _table("Actions", ("action", "what it does"), actions)
    found = specs(declared.params)
    for group in dict.fromkeys(spec.group for spec in found):
        rows = [_parameter(spec) for spec in found if spec.group == group]
        title = f"Parameters: {group}" if group else "Parameters"
        yield from _table(title, ("parameter", "default", "values", "meaning"), rows)


def _when(declared, port: str) -> str:
    notes = {"only while subscribed": "on_demand", "kept for late subscribers": "latched"}
    return ", ".join(note for note, ports in notes.items() if port in getattr(declared, ports, ()))


def _parameter(spec) -> tuple[str, ...]:
    default = getattr(spec.default, "value", spec.default)
    shown = f"`{default}`" if default != "" else ""
    meaning = _text(spec.help) + (" (reopens the source)" if spec.restart else "")
    return f"`{spec.name}`", shown, _values(spec), meaning


def _values(spec) -> str:
    if spec.choices:
        return ", ".join(f"`{one}`" for one in spec.choices)
    limits = [f"{limit:g}" for limit in (spec.min, spec.max) if limit is not None]
    return (
        f"{spec.type.__name__}, {' to '.join(limits)}" if len(limits) == 2 else spec.type.__name__
    )


def _commands() -> dict[str, Iterable[str]]:
    from ros_visualise.commands import COMMANDS, _parser

    def parser(name: str) -> argparse.ArgumentParser:
        [commands] = (one for one in _parser([name])._actions if one.dest == "command")
        return commands.choices[name]

    found = {name: COMMANDS.find(name) for name in COMMANDS.builtin}
    rows = [(f"[{name}](commands/{name}.md)", _text(one.help)) for name, one in found.items()]
    index = [
        "# Commands",
        "",
        *_table("", ("command", "what it does"), rows),
        *_contents("commands"),
    ]
    pages = {f"commands/{name}": _command(one, parser(name)) for name, one in found.items()}
    return {"commands": index, **pages}


def _command(command, parser: argparse.ArgumentParser) -> Iterator[str]:
    yield from (f"# {parser.prog.split()[-1]}", "", f"{_sentence(command.help)}", "")
    usage = parser.format_usage().removeprefix("usage: ")
    yield from ("```text", usage.rstrip(), "```", "")
    for group in parser._action_groups:
        rows = [_argument(one) for one in group._group_actions if one.help != argparse.SUPPRESS]
        title = {"positional arguments": "Arguments", "options": "Options"}.get(group.title)
        yield from _table(title or _sentence(group.title, ""), ("", "meaning"), rows)


def _argument(one: argparse.Action) -> tuple[str, str]:
    value = one.metavar or ("|".join(map(str, one.choices)) if one.choices else one.dest.upper())
    value = " ".join(value) if isinstance(value, tuple) else value
    names = ", ".join(one.option_strings)
    shown = f"{names} {value}".strip() if one.nargs != 0 or not names else names
    help = _text((one.help or "") % {**vars(one), "prog": "ros-visualise"})
    is_said = "default" in help or one.default in (None, False, True, [], "", argparse.SUPPRESS)
    return f"`{_pipe(shown)}`", help + ("" if is_said else f" (default: `{one.default}`)")


def _messages() -> Iterator[str]:
    from ros_visualise.core.message import topic_kinds

    yield from ("# Message types", "")
    yield (
        "Nodes take and publish these messages. Recordings and ROS graphs hold them under their ROS"
        " types. Other types are played, converted and shown by their definitions, too."
    )
    yield ""
    rows = [_message(kind) for kind in sorted(topic_kinds(), key=lambda kind: kind.__name__)]
    yield from _table("", ("class", "ROS type", "content"), rows)


def _message(kind) -> tuple[str, ...]:
    names = "<br>".join(f"`{one}`" for one in (kind.type_name, *kind.also_read))
    return f"`{kind.__name__}`", names, _text(_first_line(kind))


def _formats() -> Iterator[str]:
    from ros_visualise.sinks import COMPRESSIONS
    from ros_visualise.sources.formats import FORMATS

    yield from ("# File formats", "")
    rows = [
        (one.name, ", ".join(f"`{s}`" for s in one.suffixes) or "a folder") for one in FORMATS.all()
    ]
    yield from _table("Recordings that can be read", ("format", "files"), rows)
    yield "A folder of ROS 2 is found by what it holds. Videos are all that FFmpeg decodes."
    yield ""
    written = {"mcap": "`.mcap`", "folder": "a ROS 2 folder (a name without a suffix)"}
    rows = [
        (written.get(kind, f"`.{kind}`"), ", ".join(f"`{one}`" for one in found))
        for kind, found in COMPRESSIONS.items()
    ]
    yield from _table("Recordings that can be written", ("file", "compressions"), rows)
    yield "[Recordings](../reference/recordings.md) describes what a conversion keeps."


def _gallery() -> dict[str, Iterable[str]]:
    extensions = sorted((EXAMPLES / "plugin" / "src").rglob("[a-z]*.py"))
    index = ["# Gallery", "", "Examples that run as they are, each in one file.", "", "## Uses", ""]
    pages: dict[str, Iterable[str]] = {}
    for path in (*sorted(EXAMPLES.glob("[0-9]*.py")), *extensions):
        if path == extensions[0]:
            index += [
                "## Extensions",
                "",
                "Files of one package that adds them, `examples/plugin` in the repository.",
                "",
            ]
        title = _example_title(path)
        pages[f"gallery/{path.stem}"] = _example(path, title)
        index += [f"### [{title}](gallery/{path.stem}.md)", ""]
        index += [f"![{title}]({one})" for one in _picture(f"examples/{path.stem}", "../")] + [""]
    return {"gallery": [*index, *_contents("gallery")], **pages}


def _picture(name: str, up: str) -> list[str]:
    """The link to a picture, if it was made."""
    found = [one for one in (".webp", ".svg") if (PICTURES / f"{name}{one}").exists()]
    return [f"{up}pictures/{name}{one}" for one in found]


def _example_title(path: Path) -> str:
    first = ast.get_docstring(ast.parse(path.read_text())).partition("\n")[0]
    return re.split("[.:]", first)[0]


def _example(path: Path, title: str) -> Iterator[str]:
    said = ast.get_docstring(ast.parse(path.read_text()))
    first, _, rest = said.partition("\n")
    yield from (f"# {title}", "", _text(first), "")
    for block in filter(None, map(str.strip, rest.split("\n\n"))):
        is_command = block.startswith(("ros-visualise", "python", "rosrun", "pip"))
        yield from ("```sh", block, "```", "") if is_command else (_text(block), "")
    yield from (f"![{title}]({one})" for one in _picture(f"examples/{path.stem}", "../../"))
    place = path.relative_to(links.ROOT)
    yield from ("", f"The file [{place}](/../{place}):", "")
    yield from ("```python", path.read_text().partition('"""\n\n')[2].rstrip(), "```")
    if (script := path.with_suffix(".js")).exists():
        yield from (
            "",
            f"Beside it `{script.name}`:",
            "",
            "```js",
            script.read_text().rstrip(),
            "```",
        )


def _lessons(written: bool) -> dict[str, Iterable[str]]:
    """The list of lessons, and each as `explain --export` writes it, unless its page is newer."""
    import ros_visualise.lessons as room

    changed = max(path.stat().st_mtime for path in Path(room.__file__).parent.rglob("*.py"))
    lessons = list(room.LESSONS.all())
    pages = {one.name: FOLDER / "lessons" / f"{one.name}.md" for one in lessons}
    old = [n for n, page in pages.items() if not page.exists() or page.stat().st_mtime < changed]
    made = {f"lessons/{one.name}": _lesson(one) for one in lessons if written and one.name in old}
    linked = [name for name, page in pages.items() if written or page.exists()]
    rows = [
        (
            f"[{one.name}](lessons/{one.name}.md)" if one.name in linked else one.name,
            _text(one.about),
        )
        for one in lessons
    ]
    contents = _contents("lessons") if linked else []
    return {
        "lessons": ["# All lessons", "", *_table("", ("lesson", "about"), rows), *contents],
        **made,
    }


def _lesson(lesson) -> Iterator[str]:
    import cv2

    with tempfile.TemporaryDirectory() as folder:
        explain = [
            sys.executable,
            "-m",
            "ros_visualise",
            "explain",
            lesson.name,
            "--export",
            folder,
        ]
        subprocess.run(explain, check=True, stderr=subprocess.DEVNULL)
        body = re.search("<body>(.*)</body>", (Path(folder) / "index.html").read_text(), re.DOTALL)[
            1
        ]
        figures = FOLDER / "lessons" / lesson.name
        shutil.rmtree(figures, ignore_errors=True)
        figures.mkdir(parents=True)
        for png in Path(folder).glob("*.png"):
            cv2.imwrite(
                str(figures / f"{png.stem}.webp"),
                cv2.imread(str(png)),
                [cv2.IMWRITE_WEBP_QUALITY, 85],
            )
    yield from (
        f"# {lesson.name}",
        "",
        _sentence(lesson.about),
        "",
        "Move its sliders yourself:",
        "",
    )
    yield from ("```sh", f"ros-visualise explain {lesson.name}", "```", "")
    for part in re.split("(<h[123]>.*?</h[123]>|<figure>.*?</figure>)", body, flags=re.DOTALL):
        if heading := re.fullmatch("<h([23])>(.*?)</h[23]>", part, re.DOTALL):
            yield from (f"{'#' * int(heading[1])} {heading[2]}", "")
        elif image := re.search('img src="([^".]*)', part):
            yield from (f"![{image[1]}]({lesson.name}/{image[1]}.webp)", "")
        elif part.strip() and not part.startswith("<h1>"):
            yield from ("```{raw} html", part.strip(), "```", "")


def _contents(folder: str) -> list[str]:
    return ["```{toctree}", ":hidden:", ":glob:", "", f"{folder}/*", "```"]


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    if not rows:
        return
    if title:
        yield from (f"## {title}", "")
    for row in (head, ["---"] * len(head), *rows):
        yield f"| {' | '.join(row)} |"
    yield ""


def _text(text: str) -> str:
    """Text in which nothing is Markdown."""
    return _pipe(re.sub(r"([*_<`\[\]])", r"\\\1", " ".join(text.split())))


def _pipe(text: str) -> str:
    return text.replace("|", r"\|")


def _sentence(text: str, end: str = ".") -> str:
    return _text(text[:1].upper() + text[1:]).rstrip(".") + end


def _first_line(target) -> str:
    return (target.__doc__ or "").strip().partition("\n\n")[0]
