"""Pages of our own beside viser's to inspect plots, messages, log and diagnostics.

Their addresses have no path, only a query, so that they work behind a token or a proxy:
``?look=messages&topic=/edges`` is a page, ``?ask=message&topic=/edges`` a query of it.
"""

from ros_visualise.ui.look.inspector import PAGES as PAGES
from ros_visualise.ui.look.inspector import Inspector as Inspector
from ros_visualise.ui.server.answers import Answer as Answer
