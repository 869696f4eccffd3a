"""Options, output files and reports of the commands that plan."""
