"""``query`` answers questions about the results of a batch."""

import json
import re
import subprocess
import sys
from pathlib import Path

import duckdb
import forked
import pytest
from made_flights import command

from ros_visualise.batch.results import Results

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "batch.md"


def query(*arguments: object) -> subprocess.CompletedProcess[str]:
    return forked.run(command("query", *arguments), timeout=60)


def test_questions_of_the_documentation_are_answered(once):
    asked = [
        one
        for text in re.findall("```sql\n(.*?)```", PAGE.read_text(), re.DOTALL)
        for one in text.split(";")
        if one.strip()
    ]
    assert len(asked) > 10
    with Results(once / "out").open_tables() as sql:
        for one in asked:
            sql.execute(one).fetchall()
        hours, km = sql.execute(asked[0]).fetchall()[0]
    assert hours * 3600 == pytest.approx(
        sum(4 + n / 10 for n in range(4)) + sum((8 + n) / 25 for n in range(6)), abs=1.0
    )
    assert km * 1000 == pytest.approx(4 * 4, abs=1)


def test_answers_are_printed_and_written(once, tmp_path):
    out, text = once / "out", "SELECT recording, distance_m FROM recordings ORDER BY ALL"
    found = json.loads(query(out, text, "--json").stdout)
    assert found[0]["recording"] == "drive_0.mcap"
    printed = query(out, text).stdout
    assert "drive_0.mcap" in printed
    assert "distance_m" in printed
    files = [tmp_path / name for name in ("a.csv", "a.parquet", "a.svg")]
    options = [one for path in files for one in (f"--{path.suffix[1:]}", path)]
    options[4] = "--plot"
    assert query(out, text, *options).returncode == 0
    for path in files[:2]:
        assert duckdb.sql(f"FROM '{path}'").fetchall()[0][0] == "drive_0.mcap"
    assert b"drive_0.mcap" in files[2].read_bytes()
    again = query(out, text, *options)
    assert (again.returncode, len(again.stderr.splitlines())) == (2, 1)


@pytest.mark.parametrize(
    "arguments",
    [
        ("",),
        ("-- a comment",),
        ("SELEC x",),
        ("SELECT nothing FROM poses",),
        ("SELECT 1", "--plot", "a.txt"),
        ("SELECT 1", "--csv", "/dev/null/a.csv"),
    ],
    ids=str,
)
def test_a_wrong_question_is_one_line(once, arguments):
    done = query(once / "out", *arguments)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)


def test_another_folder_is_one_line(tmp_path):
    done = query(tmp_path)
    assert done.returncode == 2
    assert "no tables" in done.stderr


def test_without_duckdb_it_is_one_line(once):
    run = "from ros_visualise.commands import main; sys.exit(main())"
    code = f"import sys; sys.modules['duckdb'] = None; {run}"
    given = [sys.executable, "-c", code, "query", str(once / "out")]
    done = forked.run(given)
    assert done.returncode == 2
    assert "DuckDB" in done.stderr
    assert len(done.stderr.splitlines()) == 1
