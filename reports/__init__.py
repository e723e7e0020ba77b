"""Reports on a result folder: table, JUnit, one HTML page. They read results and never run anything."""

from hapticeval.reports.junit import junit
from hapticeval.reports.page import render_html
from hapticeval.reports.table import markdown, matrix, summary
from hapticeval.reports.write import write_reports

__all__ = ["junit", "markdown", "matrix", "render_html", "summary", "write_reports"]
