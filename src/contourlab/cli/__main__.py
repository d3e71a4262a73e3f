"""``python -m contourlab.cli``."""

from contourlab.cli.main import main

main()
