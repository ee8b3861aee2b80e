"""The entry point of `rig`: nothing is imported before an interrupt is understood."""

from __future__ import annotations

import sys

STOPPED, SHELL_INTERRUPT = 4, 130


def main() -> None:
    """Run the command line; Ctrl-C outside a run ends with the code of a stop."""
    try:
        from rig.ui.cli.main import main as command_line

        command_line()
    except KeyboardInterrupt:
        print("rig: stopped before anything was started", file=sys.stderr)
        sys.exit(STOPPED)
    except SystemExit as leaving:
        sys.exit(STOPPED if leaving.code == SHELL_INTERRUPT else leaving.code)


if __name__ == "__main__":
    main()
