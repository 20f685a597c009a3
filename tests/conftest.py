"""For every test."""

import signal

from hypothesis import settings

settings.register_profile("any machine", deadline=None)  # a busy one is slow, not wrong
settings.load_profile("any machine")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # In a script's background it is ignored, and so it would be by what tests start and interrupt.
    signal.signal(signal.SIGINT, signal.default_int_handler)
