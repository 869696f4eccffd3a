"""A run as it is drawn and told, report by report."""
