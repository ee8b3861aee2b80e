"""`rig`: the program; the one place where an error becomes a message and an exit code."""

from __future__ import annotations

import sys
import warnings
from importlib.metadata import version
from typing import Annotated, TextIO

import typer

from comms.errors import CommsError, LogError
from planners.errors import PlanError
from rig.analysis.identify.errors import AnalysisError
from rig.drives.servo.errors import ServoError
from rig.errors import BAD_DATA, EXIT_STATUS, REFUSED, USAGE, RenamedKey, RigError, StrangeValue
from rig.ui.cli.verbs import RigGroup
from rig.ui.text import without_controls
from vision.errors import VisionError

KNOWN = (RigError, CommsError, PlanError, VisionError, AnalysisError, ServoError)
MISPLACED = (FileNotFoundError, PermissionError, NotADirectoryError, IsADirectoryError)


def _exit(code: int | None, show_version: bool) -> None:
    raise typer.Exit(code or 0)


app = typer.Typer(
    name="rig",
    cls=RigGroup,
    result_callback=_exit,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Plan moves that leave a suspended load without swing, run them on a rig, and report "
    "from the log what the rig did.\n\n"
    "Exit codes: 0 ok, 2 usage or file, 3 refused before motion, 4 stopped by the operator, "
    "5 fault, 6 data not good.",
)


def _print_version(requested: bool) -> None:
    if requested:
        print(f"rig of swayless {version('swayless')}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


def main() -> None:
    """Run the command line; ends in SystemExit."""
    warnings.showwarning = _show_warning
    try:
        app()
    except SystemExit as leaving:
        if leaving.code == USAGE and _wants_json():  # the usage error itself is on stderr
            _print_refusal(
                "the command line cannot be understood; see standard error, or --help", USAGE
            )
        raise
    except KNOWN as error:
        sys.exit(_fail(str(error), _exit_code(error)))
    except OSError as error:
        sys.exit(_fail(*_explain(error)))


def _exit_code(error: Exception) -> int:
    if isinstance(error, RigError):
        return error.exit_code
    if isinstance(error, PlanError | ServoError):
        return USAGE
    return BAD_DATA if isinstance(error, LogError | VisionError | AnalysisError) else REFUSED


def _explain(error: OSError) -> tuple[str, int]:
    """Word an error of the system, with its exit code."""
    what = f"{error.filename or 'system'}: {error.strerror or error}"
    if isinstance(error, MISPLACED):
        return f"{what}; name another place", USAGE
    return f"{what}; make room or name another place", REFUSED


def _fail(message: str, code: int) -> int:
    if _wants_json():
        _print_refusal(message, code)
    _say(message)
    return code


def _say(message: str) -> None:
    """Print a message on stderr; texts of files in it cannot steer the terminal."""
    print(f"rig: {without_controls(message)}", file=sys.stderr)


def _wants_json() -> bool:
    return "--json" in sys.argv[1:]


def _print_refusal(message: str, code: int) -> None:
    from rig.ui.cli.output import print_json

    status = EXIT_STATUS[code]
    print_json({"exit_status": status, "exit_code": code, "verdict": "bad", "reasons": [message]})


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a renamed key or a strange value as a note; any other warning as Python does."""
    if issubclass(category, RenamedKey | StrangeValue):
        _say(f"note: {message}")
        return
    text = warnings.formatwarning(message, category, filename, lineno, line)
    print(text, end="", file=file or sys.stderr)
