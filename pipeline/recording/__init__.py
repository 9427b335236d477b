"""Sessions: one MCAP file holds everything that the pipeline saw in each frame, and what it decided.

    topics.py    topics and their schemas
    mcap/        the container: reading by chunk, writing so that the file is whole at any time
    session/     what a session holds, as messages, and its reader and writer
    recorder.py  records frames and results from a thread of its own
    segments.py  splits a recording into several files by size and time
    save.py      any recording as a session
    rewrite.py   clips, and recovery of what a cut file still holds
    relabel.py   the same session with other labels
    info.py      topics, rates and gaps

Every message has two times. ``publish_time`` is the header's: the sensor's own stamp, which the pipeline uses.
``log_time`` is when it was received, by the recorder's clock. A session made from another recording has no such clock,
so its log times follow the header times (``session/log_time.py``). ``log_time`` only grows within a session, and
messages are looked up by it.
"""
