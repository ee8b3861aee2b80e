"""Settings of the whole suite, and the command line as its users meet it."""

import os
import sys

import pytest
from hypothesis import settings

os.environ.pop("COLUMNS", None)  # consoles made under it would keep its width whatever a test sets

# a busy machine is no failure; in CI the same examples each time, elsewhere new ones
settings.register_profile("swayless", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("swayless")


@pytest.fixture
def rig(monkeypatch, capsys, tmp_path):
    """Call `rig ...` in an empty folder; gives exit code, stdout, stderr."""
    # imported here: a test of one room loads that room, not the whole product. output makes its
    # consoles when it is imported; under COLUMNS they would keep that width whatever a test sets
    from rig.ui.cli import main as command_line
    from rig.ui.cli import output  # noqa: F401

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["rig", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            command_line.main()
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        return left.value.code or 0, said.out, said.err

    return call
