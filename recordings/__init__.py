"""Rerun recordings of plans and runs: drawn, read back and compared. Imports only `mission` of the project.

`plan.PlanRecording` draws the results of a plan, `runs.field.FieldRecording` a robot's reports, and
`rrd.read.check` reads a file to its end. These modules load Rerun itself, so import them only where they are
used.
"""
