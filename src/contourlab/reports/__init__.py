"""Reports of a comparison: an HTML page, figures, a table for the terminal, JSON.

Reports render; every number they print is in the recordings. matplotlib and plotly are imported
when a figure is made, not before.
"""

from contourlab.reports.figures import write_figures
from contourlab.reports.page import write_report
from contourlab.reports.tables import comparison_json, comparison_table, run_json, spread_table

__all__ = [
    "comparison_json",
    "comparison_table",
    "run_json",
    "spread_table",
    "write_figures",
    "write_report",
]
