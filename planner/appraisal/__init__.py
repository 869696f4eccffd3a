"""What a plan amounts to: its figures, what it leaves out, and what is doubtful."""
