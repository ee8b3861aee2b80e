"""Process of the task `drive`."""

import sys

from comms.runner import main
from rig.run.tasks.drive.task import build

sys.exit(main(build))
