"""What can go wrong with a testbed."""


class Unavailable(Exception):  # noqa: N818
    """This machine cannot host the testbed; the message says what is missing."""


class StartFailed(Exception):  # noqa: N818
    """A part of the testbed did not come up; the message names it and its log."""
