"""Sessions: one MCAP file holds everything that the line saw at each tick, and what it believed.

    topics.py    which topics there are, and their schemas      tick.py      what ties the messages of a tick together
    about.py     where a session came from                      frames.py    the list of frames at its end
    messages.py  sensor data ↔ messages                         scene.py     results as boxes for 3D views
    packets.py   raw LiDAR packets ↔ messages and sweeps        clock.py     the times under which all is stored
    output.py    an MCAP file being written, whole at any time  writer.py    frames and results into one session
    segments.py  into several, by size and time                 recorder.py  the same from a thread of its own
    directory.py what an MCAP file holds and where              chunk.py     one chunk, unpacked
    container.py its messages, read by chunk                    session.py   a session as a ``Source``
    rewrite.py   clips, and what a cut file still holds         relabel.py   the same session with other labels
    save.py      any recording as a session                     info.py      topics, rates, gaps

Two times stand beside every message. ``publish_time`` is the header's: the sensor's own stamp, which is what the line
uses. ``log_time`` is when it was received, by the recorder's clock; where a recording was made from another one there
is no such time, and it follows the header times (``clock.py``). ``log_time`` only grows within a session, so it is what
a message is found by.
"""
