"""What the process that servers are forked from has imported and compiled, so that none of them waits for it. No test
imports this: collecting the tests would then wait for the kernels."""

from pipeline.warm_up import warm_up
from tests.app.labels import server_process

__all__ = ["server_process"]

warm_up()
