"""`rig`: the verbs, and the one place where an error becomes a message and an exit code."""

from __future__ import annotations

import sys
from importlib.metadata import version
from typing import Annotated

import typer

from comms.errors import CommsError, LogError
from planners.errors import PlanError
from rig.analysis.identify.errors import AnalysisError
from rig.drives.servo.errors import ServoError
from rig.errors import BAD_DATA, EXIT_STATUS, REFUSED, USAGE, RigError
from rig.ui.cli import (
    analyze,
    calibrate,
    compare,
    doctor,
    laws,
    motor_check,
    plan,
    run,
    servo,
    sim,
    size,
    spline,
    stop,
    track,
)
from rig.ui.cli.output import print_json
from vision.errors import VisionError

KNOWN = (RigError, CommsError, PlanError, VisionError, AnalysisError, ServoError)


def _leave(code: int | None, show_version: bool) -> None:
    raise typer.Exit(code or 0)


app = typer.Typer(
    name="rig",
    result_callback=_leave,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Plans moves that leave a suspended load without swing, runs them on a rig, and says from the log "
    "what it really did.\n\n"
    "Exit codes: 0 ok, 2 usage or file, 3 refused before motion, 4 stopped by the operator, 5 fault, 6 data not good.",
)


def _tell_version(asked: bool) -> None:
    if asked:
        print(f"rig of swayless {version('swayless')}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_tell_version, is_eager=True, help="Print the version and leave."
        ),
    ] = False,
) -> None:
    """Options of the program itself."""


app.command("doctor")(doctor.doctor)
app.command("plan")(plan.plan)
app.command("compare")(compare.compare)
app.command("run")(run.run)
app.command("stop")(stop.stop)
app.command("sim")(sim.sim)
app.command("track")(track.track)
app.command("analyze")(analyze.analyze)
app.command("spline")(spline.spline)
app.command("motor-check")(motor_check.motor_check)
app.command("size")(size.size)
app.add_typer(laws.app, name="laws")
app.add_typer(servo.app, name="servo")
app.add_typer(calibrate.app, name="calibrate")


def main() -> None:
    """Run the command line; ends in SystemExit."""
    try:
        app()
    except SystemExit as leaving:
        if (
            leaving.code == USAGE and "--json" in sys.argv[1:]
        ):  # the usage itself was told on stderr
            print_json(
                _refusal(
                    "the command line cannot be understood; see standard error, or --help", USAGE
                )
            )
        raise
    except KNOWN as error:
        sys.exit(_fail(str(error), _exit_code(error)))
    except OSError as error:
        code = (
            USAGE
            if isinstance(
                error, FileNotFoundError | PermissionError | NotADirectoryError | IsADirectoryError
            )
            else REFUSED
        )
        hint = "name another place" if code == USAGE else "make room or name another place"
        sys.exit(_fail(f"{error.filename or 'system'}: {error.strerror or error}; {hint}", code))


def _exit_code(error: Exception) -> int:
    if isinstance(error, RigError):
        return error.exit_code
    if isinstance(error, PlanError | ServoError):
        return USAGE
    return BAD_DATA if isinstance(error, LogError | VisionError | AnalysisError) else REFUSED


def _refusal(message: str, code: int) -> dict[str, object]:
    return {
        "exit_status": EXIT_STATUS[code],
        "exit_code": code,
        "verdict": "bad",
        "reasons": [message],
    }


def _fail(message: str, code: int) -> int:
    if "--json" in sys.argv[1:]:
        print_json(_refusal(message, code))
    print(f"rig: {message}", file=sys.stderr)
    return code
