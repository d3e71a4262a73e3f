"""``python -m contourlab``."""

from contourlab.cli.main import main

main()
