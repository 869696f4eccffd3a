"""Batches: many floors, storeys, dates and variants planned from one file, each again only if it changed.

    batch_file -> entries -> batch_run -> engine -> work -> store -> result_folder, record, index_page

- `batch_file` reads plans.toml. `entries` makes one entry per plan, and finds faults before any is planned.
- `content` hashes what a plan depends on: the floor as it was read, the parameters, the code.
- `store` keeps finished plans under that hash. Several processes and machines may share it.
- `engine` runs `work` in processes of this machine or on a dask cluster.
- `record` and `index_page` are what a person reads in the morning. `entry_content` says what changed.

Invariants: a result appears whole or not at all. The same content gives the same result, whichever engine,
order or number of workers. No entry ends the batch.
"""

from __future__ import annotations

from stopgo.batches.futures import PlannedBatch, start_batch

__all__ = ["PlannedBatch", "start_batch"]
