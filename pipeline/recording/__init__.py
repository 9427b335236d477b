"""Sessions: one MCAP file holds all inputs and results of the pipeline for each frame.

    topics.py    topics and their schemas
    mcap/        the container: reading by chunk, writing so that the file is always readable
    session/     the content of a session as messages, its reader and writer
    recorder.py  records frames and results on its own thread
    segments.py  splits a recording into several files by size and time
    save.py      converts any recording to a session
    rewrite.py   clips, and recovery of truncated files
    relabel.py   the same session with other labels
    info.py      topics, rates and gaps

Every message has two times. ``publish_time`` is the header's: the sensor's own stamp, which the pipeline uses.
``log_time`` is when it was received, by the recorder's clock. A session made from another recording has no such clock,
so its log times follow the header times (``session/log_time.py``). ``log_time`` only increases within a session, and
messages are looked up by it.
"""
