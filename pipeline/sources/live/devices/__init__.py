"""One module for each kind of device, and shared code: reading in a thread, reconnecting, datagrams."""
