"""Tags: printed squares whose cells encode an id."""

from ros_visualise.landmarks.tags.families import Family, family, parse_families
from ros_visualise.landmarks.tags.finder import Tag, TagFinder
from ros_visualise.landmarks.tags.patterns import draw_cells

__all__ = ["Family", "Tag", "TagFinder", "draw_cells", "family", "parse_families"]
