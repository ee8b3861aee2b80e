"""Process of the vision task."""

import sys

from comms.runner import main
from vision.task import build

sys.exit(main(build))
