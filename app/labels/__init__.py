"""What people say is true of recordings: kept in a database, with every act on it.

service/   the labels of what is open, for whoever asks: progress, scores, what to do next
acts/      what may come in, and what each act does to the labels, through store/draft.py
store/     where they lie: SQLite or PostgreSQL, the log of acts, undo, invariants, migrations
transfer/  labels as files, in and out
"""

URL_VARIABLE = "CIPV_LABELS_URL"
"""Of the environment: a team's database."""
