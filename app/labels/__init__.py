"""Labels of recordings, kept in a database together with a log of every change.

service/   the labels of the open recording: progress, scores, what to label next
acts/      requests to change labels, and their effect on the labels, through store/draft.py
store/     storage in SQLite or PostgreSQL, the log of acts, undo, invariants, migrations
transfer/  import and export of label files
tasks.py   tasks that take longer than a request may
"""

URL_VARIABLE = "CIPV_LABELS_URL"
"""Environment variable with the address of a team's database."""
