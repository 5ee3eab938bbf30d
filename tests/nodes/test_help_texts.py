"""Help texts, as a person reads them one at a time: in a list, on a slider, in a service."""

from ros_visualise.core.params import specs
from ros_visualise.nodes import find_all

DANGLING = {"of", "its", "it", "as", "or", "and", "that", "these", "growing"}


def test_each_help_says_by_itself_what_it_is_about():
    for declared in find_all():
        helps = {spec.name: spec.help for spec in specs(declared.params)} | dict(declared.actions)
        for name, help in helps.items():
            words = help.split()
            assert len(words) > 1, f"{declared.name}.{name}: {help}"
            assert words[0] not in DANGLING, f"{declared.name}.{name}: {help}"
