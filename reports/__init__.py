"""Reports on a result folder: pages, tables, JUnit. They read results and never run anything."""

from hapticeval.reports.junit import junit
from hapticeval.reports.pages import ReportView, render_pages
from hapticeval.reports.table import markdown, summaries
from hapticeval.reports.write import write_reports

__all__ = ["ReportView", "junit", "markdown", "render_pages", "summaries", "write_reports"]
