"""What people say is true of recordings: kept in a database, with every act on it.

desk.py       the labels of what is open, for whoever asks      requests.py  what comes in; refusals.py: what is refused
acts/         what each act does to them, through draft.py      log.py, steps.py  acts one after the other, and back
drive.py      the labels of one recording                       items.py, values.py, tables.py  how they lie there
database.py   where: SQLite or PostgreSQL                       migrations/  older databases made new
files.py, long.py, tasks.py  what takes a while                 scoring.py, where_next.py  runs against labels
"""

URL_VARIABLE = "CIPV_LABELS_URL"
"""Of the environment: a team's database."""
