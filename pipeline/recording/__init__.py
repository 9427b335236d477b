"""Sessions: one MCAP file holds everything that the line saw at each tick, and what it believed.

    topics.py    which topics there are, and their schemas      messages.py  sensor data ↔ messages
    tick.py      what ties the messages of one tick together    clock.py     the times under which they are stored
    output.py    an MCAP file being written, whole at any moment
    writer.py    frames and results into one file               recorder.py  the same from a thread of its own, rotating
    container.py an MCAP file read by chunk                     session.py   a session as a ``Source``
    rewrite.py   clips, and what a cut file still holds         info.py      topics, rates, gaps

Two times stand beside every message. ``publish_time`` is the header's: the sensor's own stamp, which is what the line
uses. ``log_time`` is when it was received, by the recorder's clock; where a recording was made from another one there
is no such time, and it follows the header times (``clock.py``). ``log_time`` only grows within a session, so it is what
a message is found by.
"""
