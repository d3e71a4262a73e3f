"""Machines: what really happens when a command is given."""
