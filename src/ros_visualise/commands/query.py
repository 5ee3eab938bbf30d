"""``query``: questions about the results of a batch, in SQL."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.arguments import argument, option

if TYPE_CHECKING:
    import duckdb

_MOST_ROWS = 1000  # in a terminal; files have all
_WIDEST = 10_000


@dataclass(frozen=True, kw_only=True)
class QueryOptions:
    """Options of ``query``."""

    results: Path = argument("folder of a batch's results", metavar="DIR")
    query: str = argument(
        'the query, such as "SELECT recording, distance_m FROM recordings"; the tables are'
        " described in DIR/README.md (default: list the tables)",
        default="SHOW TABLES",
        nargs="?",
        metavar="SQL",
    )
    csv: Path | None = option(None, "write the result to a CSV file", metavar="FILE")
    parquet: Path | None = option(None, "write the result to a Parquet file", metavar="FILE")
    plot: Path | None = option(
        None,
        "plot the result as .svg or .png: the first column is x, the other numeric columns are y",
        metavar="FILE",
    )
    json: bool = option(False, "print the result as a JSON array of objects")
    overwrite: bool = option(False, "replace existing files")


def run(options: QueryOptions) -> int:
    """Answer a question."""
    from contextlib import closing

    from ros_visualise.batch.results import Results
    from ros_visualise.core.printing import print_status

    with closing(Results(options.results).open_tables()) as sql:
        import duckdb  # which is there, as the tables are open

        try:
            answer = sql.sql(options.query)
            if answer is None:
                raise UsageError('query: empty; give one such as "SELECT * FROM recordings"')
            for path, write in ((options.csv, "write_csv"), (options.parquet, "write_parquet")):
                if path:
                    _save(answer, write, path, options.overwrite)
            if options.plot:
                _plot(answer, options.plot, options.overwrite)
            files = [path for path in (options.csv, options.parquet, options.plot) if path]
            for path in files:
                print_status(f"{path}: written")
            if not files:
                _print(answer, options.json)
        except duckdb.Error as error:
            raise UsageError(f"query: {str(error).splitlines()[0]}") from None
    return 0


def _save(answer: duckdb.DuckDBPyRelation, write: str, path: Path, overwrite: bool) -> None:
    from contextlib import suppress

    from ros_visualise.sinks.files import TargetFile

    TargetFile.check(path, overwrite)
    new = path.with_name(f"{path.name}.part")
    try:
        getattr(answer, write)(str(new))
        new.replace(path)
    finally:
        with suppress(OSError):
            new.unlink()


def _print(answer: duckdb.DuckDBPyRelation, as_json: bool) -> None:
    import io
    import shutil
    from contextlib import redirect_stdout

    from ros_visualise.core.printing import print_json, print_result

    if as_json:
        rows = [dict(zip(answer.columns, row, strict=True)) for row in answer.fetchall()]
        print_json(rows, default=str)
        return
    wide = shutil.get_terminal_size().columns if sys.stdout.isatty() else _WIDEST
    shown = io.StringIO()
    with redirect_stdout(shown):
        answer.show(max_rows=_MOST_ROWS, max_width=wide)
    print_result(shown.getvalue().splitlines())


def _plot(answer: duckdb.DuckDBPyRelation, path: Path, overwrite: bool) -> None:
    from ros_visualise.plotting.columns import plot_columns
    from ros_visualise.plotting.figure import FIGURE_FORMATS
    from ros_visualise.sinks.files import write_file

    if path.suffix not in FIGURE_FORMATS:
        raise UsageError(f"{path}: give a name that ends in {' or '.join(FIGURE_FORMATS)}")
    columns: dict[str, Any] = answer.fetchnumpy()
    write_file(path, FIGURE_FORMATS[path.suffix](plot_columns(columns)), overwrite)


COMMAND = Command("query the results of a batch in SQL", QueryOptions, run)
