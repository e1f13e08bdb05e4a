"""Many golden logs replayed side by side, each on a stage of its own: a driver is judged in a fraction of the time.

driver_source   another driver than this package's, packed so that it travels to workers
stage_process   the process that is one stage: it ends with whoever started it
replay_task     one golden log replayed, as a task of an engine
report          all replays as a page, JUnit XML and text
"""
