"""Drawing of a run in a recording, report by report."""
