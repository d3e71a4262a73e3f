"""Reports of comparisons and accuracy studies: an HTML page, figures, tables, JSON.

Reports render; every number they print is in the recordings. matplotlib and plotly are imported
when a figure is made, not before.
"""

from contourlab.reports.accuracy_table import (
    ACCURACY_FILES,
    accuracy_json,
    accuracy_notes,
    accuracy_tables,
    write_accuracy,
)
from contourlab.reports.chattering_figure import chattering_table, write_chattering_figure
from contourlab.reports.evaluation_page import write_evaluation
from contourlab.reports.evaluation_table import evaluation_json, evaluation_tables
from contourlab.reports.figures import write_figures
from contourlab.reports.identification_page import write_identification_report
from contourlab.reports.identification_table import identification_json, identification_table
from contourlab.reports.page import write_report
from contourlab.reports.reproduction import (
    PaperFigure,
    PaperRow,
    Reproduction,
    reproduction_json,
    reproduction_notes,
    reproduction_table,
    write_paper_figures,
)
from contourlab.reports.tables import (
    comparison_json,
    comparison_table,
    print_table,
    run_json,
    spread_table,
)
from contourlab.reports.trade_off_figure import trade_off_rows, write_trade_off_figure

__all__ = [
    "ACCURACY_FILES",
    "PaperFigure",
    "PaperRow",
    "Reproduction",
    "accuracy_json",
    "accuracy_notes",
    "accuracy_tables",
    "chattering_table",
    "comparison_json",
    "comparison_table",
    "evaluation_json",
    "evaluation_tables",
    "identification_json",
    "identification_table",
    "print_table",
    "reproduction_json",
    "reproduction_notes",
    "reproduction_table",
    "run_json",
    "spread_table",
    "trade_off_rows",
    "write_accuracy",
    "write_chattering_figure",
    "write_evaluation",
    "write_figures",
    "write_identification_report",
    "write_paper_figures",
    "write_report",
    "write_trade_off_figure",
]
