"""The entry point of `rig`: nothing is imported before an interrupt is understood."""

from __future__ import annotations

import sys

STOPPED, SHELL_INTERRUPT = 4, 130
STOP_PRIORITY = 6  # SCHED_FIFO where it is allowed: above the operator, below its tasks


def main() -> None:
    """Run the command line; Ctrl-C outside a run ends with the code of a stop."""
    if sys.argv[1:2] == ["stop"]:
        _hurry()
    try:
        from rig.ui.cli.main import main as command_line

        command_line()
    except KeyboardInterrupt:
        print("rig: stopped before anything was started", file=sys.stderr)
        sys.exit(STOPPED)
    except SystemExit as leaving:
        sys.exit(STOPPED if leaving.code == SHELL_INTERRUPT else leaving.code)


def _hurry() -> None:
    """Take the processor before all but the tasks of the run: a stop is not to wait for others."""
    from comms.priority import take_priority

    take_priority(STOP_PRIORITY, is_bounded=False)


if __name__ == "__main__":
    main()
