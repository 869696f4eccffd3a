"""What is drawn into Rerun files, read back, and compared. Imports `mission` and nothing else of the project.

`plan.PlanRecording` takes each noun of a plan, `field.FieldRecording` takes what a robot tells, `read.check`
reads a file back to its end. Rerun itself is loaded by those modules, so import them where they are used.
"""
