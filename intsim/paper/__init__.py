"""The figures of the paper beside ours: its printed numbers, the tasks of each figure, and tables of both."""
