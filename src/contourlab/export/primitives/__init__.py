"""What each primitive of JAX becomes in C, by kind; :mod:`.table` finds the one for an equation."""
