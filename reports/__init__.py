"""Reports on a result folder: pages, tables, JUnit. They read results and never run anything."""

from hapticeval.reports.exports import write_figures
from hapticeval.reports.index import render_index
from hapticeval.reports.junit import junit
from hapticeval.reports.table import markdown, summaries
from hapticeval.reports.write import write_reports

__all__ = ["junit", "markdown", "render_index", "summaries", "write_figures", "write_reports"]
