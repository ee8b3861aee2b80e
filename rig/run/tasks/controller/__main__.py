"""The controller as a process."""

import sys

from comms.runner import main
from rig.run.tasks.controller.task import build

sys.exit(main(build))
