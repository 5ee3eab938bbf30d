"""``python -m ros_visualise`` is ``ros-visualise``."""

import sys

from ros_visualise.entry import main

sys.exit(main())
