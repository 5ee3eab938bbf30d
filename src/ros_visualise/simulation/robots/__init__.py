"""The robots: how they are driven, and what their bodies do."""
