"""Damaged input of every kind, by the thousand: ``make fuzz``; see `fuzz.__main__`."""
