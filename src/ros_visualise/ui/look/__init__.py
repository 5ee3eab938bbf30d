"""Looking closely: pages of our own beside viser's, which ask for what they show.

Their addresses have no path, only a question, so that they hold behind a token or a proxy:
``?look=image&topic=/edges`` is a page, ``?ask=pixels&topic=/edges`` what it asks for.
"""

from ros_visualise.ui.look.answers import Answer as Answer
from ros_visualise.ui.look.looker import PAGES as PAGES
from ros_visualise.ui.look.looker import Looker as Looker
from ros_visualise.ui.look.looker import link as link
