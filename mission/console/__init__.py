"""What every command shares: the process and its signals, tables, JSON answers, plug-ins and ports."""
